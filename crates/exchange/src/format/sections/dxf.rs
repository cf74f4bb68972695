//! Sections as a drawing exchange file of AutoCAD 2000 (Autodesk, "AutoCAD 2000 DXF Reference", 1999): the oldest version with a variable for units, which are millimetres.
//!
//! Files of that version name everything by handles and list what entities refer to: tables of line types, layers, text styles and block records, the two blocks of model and paper space,
//! and a dictionary. These have the same handles in every file; entities have the numbers after those of the layers.

use super::{Out, push_number};
use crate::format::Metadata;
use crate::format::error::FormatError;
use crate::format::off::flush_full;
use glam::DVec3;
use lacuna_kernel::measure::section::Section;
use std::io::Write;

/// Letters of a layer's name, and of a line of text.
const NAME_LETTERS: usize = 31;
const LINE_LETTERS: usize = 255;

/// The block record of model space, which owns all entities.
const MODEL_SPACE: &str = "1F";
/// The handle of the table of layers.
const LAYERS: &str = "2";
/// The handle of the first layer of a section.
const FIRST_HANDLE: u64 = 0x100;

/// Up to the name of the application: units are millimetres (4), and measures metric (1). Handles of entities are below the seed, whatever their number.
const HEADER: &str =
    "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1015\n9\n$HANDSEED\n5\nFFFFFFFF\n9\n$MEASUREMENT\n70\n1\n9\n$INSUNITS\n70\n4\n9\n$EXTMIN\n";

/// From the header's end to the table of layers.
const BEFORE_LAYERS: &str = concat!(
    "0\nENDSEC\n0\nSECTION\n2\nCLASSES\n0\nENDSEC\n0\nSECTION\n2\nTABLES\n",
    "0\nTABLE\n2\nVPORT\n5\n8\n330\n0\n100\nAcDbSymbolTable\n70\n0\n0\nENDTAB\n",
    "0\nTABLE\n2\nLTYPE\n5\n5\n330\n0\n100\nAcDbSymbolTable\n70\n3\n",
    "0\nLTYPE\n5\n14\n330\n5\n100\nAcDbSymbolTableRecord\n100\nAcDbLinetypeTableRecord\n2\nByBlock\n70\n0\n3\n\n72\n65\n73\n0\n40\n0\n",
    "0\nLTYPE\n5\n15\n330\n5\n100\nAcDbSymbolTableRecord\n100\nAcDbLinetypeTableRecord\n2\nByLayer\n70\n0\n3\n\n72\n65\n73\n0\n40\n0\n",
    "0\nLTYPE\n5\n16\n330\n5\n100\nAcDbSymbolTableRecord\n100\nAcDbLinetypeTableRecord\n2\nContinuous\n70\n0\n3\nSolid line\n72\n65\n73\n0\n40\n0\n",
    "0\nENDTAB\n",
);

/// From the table of layers to the entities.
const AFTER_LAYERS: &str = concat!(
    "0\nENDTAB\n",
    "0\nTABLE\n2\nSTYLE\n5\n3\n330\n0\n100\nAcDbSymbolTable\n70\n1\n",
    "0\nSTYLE\n5\n11\n330\n3\n100\nAcDbSymbolTableRecord\n100\nAcDbTextStyleTableRecord\n2\nStandard\n70\n0\n40\n0\n41\n1\n50\n0\n71\n0\n42\n2.5\n3\ntxt\n4\n\n0\nENDTAB\n",
    "0\nTABLE\n2\nVIEW\n5\n6\n330\n0\n100\nAcDbSymbolTable\n70\n0\n0\nENDTAB\n",
    "0\nTABLE\n2\nUCS\n5\n7\n330\n0\n100\nAcDbSymbolTable\n70\n0\n0\nENDTAB\n",
    "0\nTABLE\n2\nAPPID\n5\n9\n330\n0\n100\nAcDbSymbolTable\n70\n1\n",
    "0\nAPPID\n5\n12\n330\n9\n100\nAcDbSymbolTableRecord\n100\nAcDbRegAppTableRecord\n2\nACAD\n70\n0\n0\nENDTAB\n",
    "0\nTABLE\n2\nDIMSTYLE\n5\nA\n330\n0\n100\nAcDbSymbolTable\n70\n1\n100\nAcDbDimStyleTable\n",
    "0\nDIMSTYLE\n105\n27\n330\nA\n100\nAcDbSymbolTableRecord\n100\nAcDbDimStyleTableRecord\n2\nStandard\n70\n0\n340\n11\n0\nENDTAB\n",
    "0\nTABLE\n2\nBLOCK_RECORD\n5\n1\n330\n0\n100\nAcDbSymbolTable\n70\n2\n",
    "0\nBLOCK_RECORD\n5\n1F\n330\n1\n100\nAcDbSymbolTableRecord\n100\nAcDbBlockTableRecord\n2\n*Model_Space\n",
    "0\nBLOCK_RECORD\n5\n1B\n330\n1\n100\nAcDbSymbolTableRecord\n100\nAcDbBlockTableRecord\n2\n*Paper_Space\n",
    "0\nENDTAB\n0\nENDSEC\n0\nSECTION\n2\nBLOCKS\n",
    "0\nBLOCK\n5\n20\n330\n1F\n100\nAcDbEntity\n8\n0\n100\nAcDbBlockBegin\n2\n*Model_Space\n70\n0\n10\n0\n20\n0\n30\n0\n3\n*Model_Space\n1\n\n",
    "0\nENDBLK\n5\n21\n330\n1F\n100\nAcDbEntity\n8\n0\n100\nAcDbBlockEnd\n",
    "0\nBLOCK\n5\n1C\n330\n1B\n100\nAcDbEntity\n67\n1\n8\n0\n100\nAcDbBlockBegin\n2\n*Paper_Space\n70\n0\n10\n0\n20\n0\n30\n0\n3\n*Paper_Space\n1\n\n",
    "0\nENDBLK\n5\n1D\n330\n1B\n100\nAcDbEntity\n67\n1\n8\n0\n100\nAcDbBlockEnd\n",
    "0\nENDSEC\n0\nSECTION\n2\nENTITIES\n",
);

pub(super) const END: &[u8] = b"0\nENDSEC\n0\nSECTION\n2\nOBJECTS\n\
0\nDICTIONARY\n5\nC\n330\n0\n100\nAcDbDictionary\n281\n1\n3\nACAD_GROUP\n350\nD\n\
0\nDICTIONARY\n5\nD\n330\nC\n100\nAcDbDictionary\n281\n1\n0\nENDSEC\n0\nEOF\n";

/// The handles of a file.
#[derive(Debug)]
pub(super) struct Handles {
    next: u64,
}

impl Handles {
    fn take(&mut self) -> u64 {
        self.next += 1;
        self.next - 1
    }
}

/// All up to the entities, with a layer of each name.
pub(super) fn start<W: Write>(
    [low, high]: [DVec3; 2],
    layers: &[String],
    metadata: &Metadata<'_>,
    out: &mut Out<'_, W>,
) -> Result<Handles, FormatError> {
    comment(out.text, metadata.title.unwrap_or("sections"));
    comment(out.text, metadata.application);
    comment(out.text, "lengths in millimetres");
    out.text.extend_from_slice(HEADER.as_bytes());
    position(out.text, low);
    out.text.extend_from_slice(b"9\n$EXTMAX\n");
    position(out.text, high);
    out.text.extend_from_slice(BEFORE_LAYERS.as_bytes());
    let count = layers.len() + 1;
    out.text.extend_from_slice(format!("0\nTABLE\n2\nLAYER\n5\n{LAYERS}\n330\n0\n100\nAcDbSymbolTable\n70\n{count}\n").as_bytes());
    table_layer(out.text, 0x10, "0");
    let mut handles = Handles { next: FIRST_HANDLE };
    for name in layers {
        table_layer(out.text, handles.take(), name);
        flush_full(out.text, out.sink)?;
    }
    out.text.extend_from_slice(AFTER_LAYERS.as_bytes());
    Ok(handles)
}

/// A layer of the colour that is black on white and white on black (7), with continuous lines.
fn table_layer(text: &mut Vec<u8>, handle: u64, name: &str) {
    text.extend_from_slice(
        format!("0\nLAYER\n5\n{handle:X}\n330\n{LAYERS}\n100\nAcDbSymbolTableRecord\n100\nAcDbLayerTableRecord\n2\n{name}\n70\n0\n62\n7\n6\nContinuous\n")
            .as_bytes(),
    );
}

/// The layer of a height: names are of capitals, digits and `$-_`, and short. Heights of too many digits are numbered.
pub(super) fn layer(height: &str, number: usize) -> String {
    let name = format!("Z_{}", height.replace('.', "_"));
    if name.len() <= NAME_LETTERS { name } else { format!("SECTION_{number}") }
}

/// A closed plane polyline for each loop, at its height, outer ones counter-clockwise.
pub(super) fn section<W: Write>(section: &Section, layer: &str, handles: &mut Handles, out: &mut Out<'_, W>) -> Result<(), FormatError> {
    for points in section.loops() {
        let (handle, count) = (handles.take(), points.len());
        let head = format!(
            "0\nLWPOLYLINE\n5\n{handle:X}\n330\n{MODEL_SPACE}\n100\nAcDbEntity\n8\n{layer}\n100\nAcDbPolyline\n90\n{count}\n70\n1\n38\n"
        );
        out.text.extend_from_slice(head.as_bytes());
        push_number(out.text, section.offset_mm);
        out.text.push(b'\n');
        out.each(points, |_, point, text| pairs(text, &point.to_array()))?;
    }
    Ok(())
}

fn position(text: &mut Vec<u8>, position: DVec3) {
    pairs(text, &position.to_array());
}

/// Coordinates with their codes.
fn pairs(text: &mut Vec<u8>, coordinates: &[f64]) {
    for (code, &value) in [b"10\n", b"20\n", b"30\n"].into_iter().zip(coordinates) {
        text.extend_from_slice(code);
        push_number(text, value);
        text.push(b'\n');
    }
}

/// Words that readers skip, on one line of ASCII: other characters by their number, as AutoCAD writes them.
fn comment(text: &mut Vec<u8>, words: &str) {
    text.extend_from_slice(b"999\n");
    let end = text.len() + LINE_LETTERS;
    for letter in words.chars() {
        let code = u32::from(letter);
        let shown = if letter.is_control() {
            " ".to_owned()
        } else if letter.is_ascii() {
            letter.to_string()
        } else {
            format!("\\U+{code:04X}")
        };
        if text.len() + shown.len() > end {
            break;
        }
        text.extend_from_slice(shown.as_bytes());
    }
    text.push(b'\n');
}
