//! That triangles which stand for the surface of solids wind around nothing that is outside of these and far from them.
//!
//! Around a solid there is a sheet outside alone, which winds around what is farther away as often as the triangles T do that it is out from. Let every place of T move inward, straight to one of T', with all ways no farther from the surface S than D, and let T' meet S nowhere, and be where S winds more than 0 times. Then T and T' wind as often around
//! what is farther from S than D. Where S winds 0 times space hangs together in parts, each of which has some of S on its border; T' meets neither these nor S, so it winds as often around such a part as around what of S is there, and as around all of S that hangs together with it. Where that is 0, T winds around nothing that is outside of solids and farther from S than D.
//! Sheets that hang together are cut each by itself first (`crossed`), which changes no sum where none of the parts of T' winds otherwise than 0 or once, those that face inwards the other way.

use super::Around;
use super::coarse::lifted;
use super::skin::Skin;
use crate::attractor::cell::{Point, dot};
use crate::budget::{Budget, Stopped};
use crate::dilation::arrangement::between::Memory;
use crate::dilation::arrangement::faces::Question;
use crate::groups::Groups;
use crate::measure::mass::volume;
use crate::solid::{Inside, TriMesh};
use glam::DVec3;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// How far inward places are tried, in units of half the band: farther where triangles cut off hollows, less far where the solid is thin.
const INWARD: [f64; 4] = [1.0, 0.25, 4.0, 0.06];
/// How far from the surface they have to be at least, as a share of that.
const LEAST: f64 = 0.1;
/// The least cosine of the angle between the way inward at a place and a normal there.
const LEAST_COSINE: f64 = 0.2;
/// Parts of triangles and of the surface at most, in pairs.
const MOST_PAIRS: usize = 10_000;
/// Triangles one after the other.
const IN_A_ROW: usize = 64;

impl Around<'_> {
    /// Whether that is shown of triangles of the surface, beyond the outer distance less what may move.
    ///
    /// # Errors
    /// [`Stopped`].
    pub(super) fn wind_inside(&self, triangles: &[[u32; 3]], budget: &Budget) -> Result<bool, Stopped> {
        let surface = self.skin.mesh();
        let solid = Inside::new(&surface);
        for share in INWARD {
            if self.wind_inside_by(share * self.half(), triangles, &solid, budget)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn wind_inside_by(&self, by: f64, triangles: &[[u32; 3]], solid: &Inside<'_>, budget: &Budget) -> Result<bool, Stopped> {
        let skin = self.skin;
        let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
        let corners: Vec<[u32; 3]> = triangles
            .iter()
            .map(|corners| {
                corners.map(|corner| {
                    let next = numbers.len() as u32;
                    *numbers.entry(skin.seams.first(corner)).or_insert(next)
                })
            })
            .collect();
        let (mut vertices, mut feet) = (vec![DVec3::ZERO; numbers.len()], vec![DVec3::ZERO; numbers.len()]);
        for (&place, &number) in &numbers {
            let Some(inward) = skin.inward(place, by) else { return Ok(false) };
            vertices[number as usize] = DVec3::from_array(inward);
            feet[number as usize] = DVec3::from_array(skin.places[place as usize]);
        }
        let inward = TriMesh { vertices, triangles: corners };
        let look = |row: &[u32]| {
            budget.cancel.check()?;
            let mut memory = Memory::default();
            let mut is_so = |&triangle: &u32| {
                let feet = triangles[triangle as usize];
                let owners = feet.map(|foot| skin.around.at(foot)[0]);
                let question = Question {
                    triangle: inward.points_of(triangle),
                    feet: Some(feet.map(|foot| skin.places[foot as usize])),
                    owners,
                    inner: LEAST * by,
                    outer: self.outer - self.moved,
                };
                self.faces.fault_with(|place| Some(skin.near(owners[0], place)), &question, &mut memory).is_none()
            };
            Ok(row.iter().all(&mut is_so))
        };
        let numbers: Vec<u32> = (0..triangles.len() as u32).collect();
        if !numbers.par_chunks(IN_A_ROW).map(look).collect::<Result<Vec<bool>, Stopped>>()?.into_iter().all(|is_so| is_so) {
            return Ok(false);
        }
        // A group is called by the least of its vertices.
        let firsts = |groups: &[u32]| (0..).zip(groups).filter(|&(vertex, &group)| vertex == group).map(|own| own.0).collect::<Vec<u32>>();
        let own = Groups::of_triangles(inward.vertices.len(), &inward.triangles).all();
        let others = firsts(&Groups::of_triangles(skin.places.len(), &skin.triangles).all());
        let parts = firsts(&own);
        if parts.len() * others.len() > MOST_PAIRS || !parts.iter().all(|&first| solid.winding(inward.vertices[first as usize]) > 0) {
            return Ok(false);
        }
        let mut sums = vec![0; others.len()];
        for part in parts {
            budget.cancel.check()?;
            let triangles: Vec<[u32; 3]> = inward.triangles.iter().copied().filter(|corners| own[corners[0] as usize] == part).collect();
            // Which way a part faces is told by its feet, as where it is cut.
            let side = if volume(&TriMesh { vertices: feet.clone(), triangles: triangles.clone() }) > 0.0 { 1 } else { -1 };
            let part = TriMesh { vertices: inward.vertices.clone(), triangles };
            let part = Inside::new(&part);
            for (sum, &other) in sums.iter_mut().zip(&others) {
                let winding = part.winding(DVec3::from_array(skin.places[other as usize]));
                if winding != 0 && winding != side {
                    return Ok(false);
                }
                *sum += winding;
            }
        }
        Ok(sums.iter().all(|&sum| sum == 0))
    }
}

impl Skin {
    /// The surface as a mesh, with one vertex at each place.
    fn mesh(&self) -> TriMesh {
        let triangles = self.triangles.iter().map(|corners| corners.map(|corner| self.seams.first(corner))).collect();
        TriMesh { vertices: self.places.iter().copied().map(DVec3::from_array).collect(), triangles }
    }

    /// The place that is as far inward of the planes of all triangles at a vertex as a distance, or farther; none where these turn too much.
    fn inward(&self, vertex: u32, by: f64) -> Option<Point> {
        let outward = self.outward(vertex);
        let own = [vertex];
        let copies = self.seams.copies(vertex).unwrap_or(&own).iter();
        let normals = copies.flat_map(|&copy| self.around.at(copy)).map(|&triangle| &self.normals[triangle as usize]);
        let cosine = normals.map(|normal| dot(normal, &outward)).fold(1.0, f64::min);
        (cosine > LEAST_COSINE).then(|| lifted(&self.places[vertex as usize], &outward, -by / cosine))
    }
}
