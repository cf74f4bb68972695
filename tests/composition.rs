//! The composition files, read as a container engine reads them: what they set the program must know, what they start must start, and what they
//! open is open to this machine alone.

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;

use lacuna_tests::support::binary::lacuna;
use lacuna_tests::support::root;
use saphyr::{LoadableYamlNode, Yaml};
use serde_json::{Map, Value};

const FILES: [&str; 2] = ["compose.yaml", "compose.distributed.yaml"];

/// A file with anchors resolved, merge keys merged and variables in place, as an engine sees it.
fn composition(name: &str) -> Value {
    let text = fs::read_to_string(root().join("docker").join(name)).unwrap();
    let documents = Yaml::load_from_str(&text).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(documents.len(), 1, "{name} is one document");
    substituted(value(&documents[0]))
}

/// YAML as JSON; `<<` of the merge key's type takes what the mapping does not say itself.
fn value(node: &Yaml<'_>) -> Value {
    if let Some(list) = node.as_sequence() {
        return list.iter().map(value).collect();
    }
    let Some(mapping) = node.as_mapping() else {
        return match (node.as_bool(), node.as_integer(), node.as_str()) {
            (Some(flag), _, _) => flag.into(),
            (_, Some(number), _) => number.into(),
            (_, _, Some(text)) => text.into(),
            _ => Value::Null,
        };
    };
    let (mut own, mut merged) = (Map::new(), Map::new());
    for (key, inner) in mapping {
        let key = key.as_str().unwrap();
        match (key, value(inner)) {
            ("<<", Value::Object(more)) => merged.extend(more),
            (_, inner) => assert!(own.insert(key.to_owned(), inner).is_none(), "{key} is said twice"),
        }
    }
    merged.extend(own);
    Value::Object(merged)
}

/// `${NAME:-default}` and `${NAME:?reason}` as an engine puts values in their places, every name with a value of its own.
fn substituted(value: Value) -> Value {
    match value {
        Value::String(text) => {
            let (mut whole, mut rest) = (String::new(), text.as_str());
            while let Some((before, variable)) = rest.split_once("${") {
                let (variable, after) = variable.split_once('}').unwrap_or_else(|| panic!("{text} does not close a variable"));
                let place = variable.find(':').unwrap_or_else(|| panic!("{text}: neither a default nor a reason to refuse"));
                let (name, rule) = variable.split_at(place);
                assert!(name.bytes().all(|byte| byte.is_ascii_uppercase() || byte == b'_'), "{text}");
                whole += before;
                whole += rule.strip_prefix(":-").unwrap_or("as-said-from-outside");
                assert!(rule.len() > 2 && (rule.starts_with(":-") || rule.starts_with(":?")), "{text}");
                rest = after;
            }
            (whole + rest).into()
        }
        Value::Array(list) => list.into_iter().map(substituted).collect(),
        Value::Object(members) => Value::Object(members.into_iter().map(|(key, value)| (key, substituted(value))).collect()),
        other => other,
    }
}

fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

fn list(value: &Value) -> Vec<String> {
    value.as_array().map(|list| list.iter().map(text).collect()).unwrap_or_default()
}

/// The services that run this program's image, and the others.
fn services(name: &str) -> (BTreeMap<String, Value>, BTreeMap<String, Value>) {
    let whole = composition(name);
    let all = whole["services"].as_object().unwrap().clone();
    all.into_iter().partition(|(_, service)| service["build"].is_object())
}

/// What the last stage of the Dockerfile says with a keyword.
fn image(keyword: &str) -> String {
    let text = fs::read_to_string(root().join("docker/Dockerfile")).unwrap().replace("\\\n", " ");
    text[text.rfind("\nFROM ").unwrap()..].lines().find_map(|line| line.strip_prefix(keyword)).unwrap().trim().to_owned()
}

/// The environment of a service: what the image sets, and what the composition does.
fn environment(service: &Value) -> BTreeMap<String, String> {
    let of_image = image("ENV ");
    let pairs = of_image.split_whitespace().map(|pair| pair.split_once('=').unwrap());
    let mut all: BTreeMap<String, String> = pairs.map(|(name, value)| (name.to_owned(), value.to_owned())).collect();
    all.extend(service["environment"].as_object().unwrap().iter().map(|(name, value)| (name.clone(), text(value))));
    all
}

#[test]
fn every_variable_is_a_setting_that_the_program_takes() {
    for name in FILES {
        for (service, stated) in services(name).0 {
            let variables = environment(&stated);
            let output = Command::new(lacuna()).arg("doctor").env_clear().envs(&variables).output().unwrap();
            assert!(output.status.success(), "{name}, {service}: {}", String::from_utf8_lossy(&output.stderr));
            let told: Value = serde_json::from_slice(&output.stdout).unwrap();
            let settings = told["settings"].as_array().unwrap();
            for variable in variables.keys() {
                let setting = settings.iter().find(|setting| setting["name"] == variable.as_str());
                let setting = setting.unwrap_or_else(|| panic!("{name}, {service}: nobody reads {variable}"));
                assert_eq!(setting["origin"], "environment", "{name}, {service}: {setting}");
            }
        }
    }
}

#[test]
fn what_is_started_is_what_the_command_line_knows() {
    let exec = |text: &str| serde_json::from_str::<Vec<String>>(text).unwrap_or_else(|_| panic!("{text} is not in exec form"));
    let entry = exec(&image("ENTRYPOINT "));
    let health = image("HEALTHCHECK ");
    let health = exec(health.split_once("CMD ").unwrap().1);
    for name in FILES {
        for (service, stated) in services(name).0 {
            for member in ["entrypoint", "healthcheck"] {
                assert!(stated[member].is_null(), "{name}, {service}: the image says its {member}");
            }
            let command = if stated["command"].is_null() { exec(&image("CMD ")) } else { list(&stated["command"]) };
            for arguments in [[&entry[1..], &command].concat(), health[1..].to_vec()] {
                let known = Command::new(lacuna()).args(&arguments).arg("--help").output().unwrap();
                assert!(known.status.success(), "{name}, {service}: {arguments:?}: {}", String::from_utf8_lossy(&known.stderr));
            }
        }
    }
    assert_eq!((entry[0].as_str(), health[0].as_str()), ("lacuna", "lacuna"));
}

#[test]
fn ports_and_probes_are_those_of_the_program_and_open_to_this_machine() {
    for name in FILES {
        let (ours, others) = services(name);
        let mut taken = Vec::new();
        for (service, stated) in &ours {
            let bound = environment(stated)["LACUNA_BIND"].clone();
            let (_, inside) = bound.rsplit_once(':').unwrap();
            assert_eq!(inside, image("EXPOSE "), "{name}, {service}");
            let role = environment(stated).get("LACUNA_ROLE").cloned().unwrap_or_else(|| "all".to_owned());
            let ports = list(&stated["ports"]);
            assert_eq!(ports.is_empty(), role == "worker", "{name}, {service}: {ports:?}");
            for port in &ports {
                let [address, outside, to] = port.split(':').collect::<Vec<_>>()[..] else { panic!("{name}, {service}: {port}") };
                assert_eq!((address, to), ("127.0.0.1", inside), "{name}, {service}");
                assert!(!taken.contains(&outside.to_owned()), "{name}: {outside} is taken twice");
                taken.push(outside.to_owned());
            }
            // Time to end what runs: longer than the program takes for it.
            let grace = text(&stated["stop_grace_period"]);
            assert!(grace.strip_suffix('s').unwrap().parse::<u32>().unwrap() > 20, "{name}, {service}: {grace}");
        }
        for (service, stated) in &others {
            assert!(stated["ports"].is_null(), "{name}: {service} is for this service alone");
            let check = list(&stated["healthcheck"]["test"]);
            assert!(stated["healthcheck"].is_null() || check[0] == "CMD", "{name}, {service}: {check:?} is not in exec form");
            let floats = |image: &str| !image.contains(':') || image.ends_with(":latest");
            assert!(!floats(&text(&stated["image"])), "{name}: {service} floats");
        }
        // Who is waited for is there, and can say that it is healthy.
        for (service, stated) in ours.iter().chain(&others) {
            for (other, condition) in stated["depends_on"].as_object().into_iter().flatten() {
                assert!(others.contains_key(other), "{name}: {service} waits for {other}");
                let healthy = condition["condition"] == "service_healthy";
                assert!(!healthy || others[other]["healthcheck"].is_object(), "{name}: {other} has no probe");
            }
        }
    }
}

#[test]
fn nobody_is_root_and_one_place_is_written_to() {
    let (user, group) = image("USER ").split_once(':').map(|(user, group)| (user.to_owned(), group.to_owned())).unwrap();
    assert!(user.parse::<u32>().unwrap() > 1000 && group.parse::<u32>().unwrap() > 1000);
    for name in FILES {
        let whole = composition(name);
        let named: Vec<&String> = whole["volumes"].as_object().unwrap().keys().collect();
        let (ours, others) = services(name);
        let mut used = Vec::new();
        for (service, stated) in &ours {
            assert!(stated["user"].is_null() && stated["privileged"].is_null(), "{name}, {service}");
            assert_eq!(stated["read_only"], true, "{name}, {service}");
            assert_eq!(
                (list(&stated["cap_drop"]), list(&stated["security_opt"])),
                (vec!["ALL".into()], vec!["no-new-privileges:true".into()])
            );
            // The data folder, and /tmp, in memory; nothing else can be written to.
            let data = environment(stated)["LACUNA_DATA"].clone();
            let volumes = list(&stated["volumes"]);
            let kept: Vec<&str> = volumes.iter().map(|volume| volume.split_once(':').unwrap().1).collect();
            let in_memory = list(&stated["tmpfs"]);
            let fleeting: Vec<&str> = in_memory.iter().map(|place| place.split(':').next().unwrap()).collect();
            let mut places: Vec<&str> = kept.iter().chain(&fleeting).copied().collect();
            places.sort_unstable();
            assert_eq!(places, [data.as_str(), "/tmp"], "{name}, {service}");
            // Writable for the image's user: by its mode, as Podman knows no owner of such volumes.
            for place in in_memory.iter().filter(|place| place.starts_with(&data)) {
                assert!(place.split([':', ',']).any(|option| option == "mode=1777") && !place.contains("uid="), "{place}");
            }
            used.extend(volumes);
        }
        used.extend(others.values().flat_map(|stated| list(&stated["volumes"])));
        let mut used: Vec<&str> = used.iter().map(|volume| volume.split(':').next().unwrap()).collect();
        used.sort_unstable();
        assert_eq!(used, named, "{name}: every volume has one user");
    }
}
