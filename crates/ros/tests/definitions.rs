//! Texts of messages with everything that is in them.

use std::collections::BTreeSet;

use teleclay_ros::{definition, interfaces};

/// Type names and texts of a definition.
fn parts(name: &str) -> Vec<(String, String)> {
    let text = definition(name).unwrap();
    let rule = format!("{}\n", "=".repeat(80));
    let mut parts = text.split(rule.as_str());
    let first = (name.to_owned(), parts.next().unwrap().to_owned());
    let others = parts.map(|part| {
        let (title, text) = part.split_once('\n').unwrap();
        let name = title.strip_prefix("MSG: ").unwrap();
        (name.replace('/', "/msg/"), text.to_owned())
    });
    std::iter::once(first).chain(others).collect()
}

/// The types that the fields of a text have, but for the language's own.
fn types(package: &str, text: &str) -> BTreeSet<String> {
    let plain = [
        "bool", "byte", "char", "uint8", "int32", "uint32", "int64", "uint64", "float64", "string",
    ];
    let lines = text.lines().map(str::trim);
    let kinds = lines
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(|line| line.split([' ', '[']).next().unwrap())
        .filter(|kind| !plain.contains(kind));
    kinds
        .map(|kind| match kind.split_once('/') {
            Some((package, name)) => format!("{package}/msg/{name}"),
            None => format!("{package}/msg/{kind}"),
        })
        .collect()
}

#[test]
fn a_definition_has_each_type_that_is_in_it_once_and_no_other() {
    for name in interfaces().filter(|name| name.contains("/msg/")) {
        let parts = parts(name);
        let mut wanted: BTreeSet<String> = BTreeSet::from([name.to_owned()]);
        for (part, text) in &parts {
            wanted.extend(types(part.split('/').next().unwrap(), text));
        }
        let told: Vec<&String> = parts.iter().map(|(name, _)| name).collect();
        let told_once: BTreeSet<String> = told.iter().map(|name| (*name).clone()).collect();
        assert_eq!(told.len(), told_once.len(), "{name}");
        assert_eq!(told_once, wanted, "{name}");
    }
}

#[test]
fn a_stamped_pose_has_five_types_in_it() {
    let names: BTreeSet<String> = parts("geometry_msgs/msg/PoseStamped")
        .into_iter()
        .map(|(name, _)| name)
        .collect();
    let wanted = [
        "builtin_interfaces/msg/Time",
        "geometry_msgs/msg/Point",
        "geometry_msgs/msg/Pose",
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/Quaternion",
        "std_msgs/msg/Header",
    ];
    assert_eq!(names, BTreeSet::from(wanted.map(str::to_owned)));
}

#[test]
fn the_halves_of_a_service_have_texts_and_the_whole_has_none() {
    let half = |name: &str| definition(&format!("std_srvs/srv/{name}"));
    assert_eq!(half("SetBool_Request").as_deref(), Some("bool data\n"));
    assert_eq!(half("Trigger_Request").as_deref(), Some(""));
    assert_eq!(
        half("Trigger_Response").as_deref(),
        Some("bool success\nstring message\n")
    );
    assert_eq!(half("SetBool"), None);
}

/// What users build is what is spoken: each file of the package is an interface here, and is in its list.
#[test]
fn the_package_for_ros_2_has_our_interfaces_and_no_other() {
    let package = concat!(env!("CARGO_MANIFEST_DIR"), "/../../ros2/teleclay_msgs");
    let mut files = BTreeSet::new();
    for folder in ["msg", "srv"] {
        for file in std::fs::read_dir(format!("{package}/{folder}")).unwrap() {
            let name = file.unwrap().file_name().into_string().unwrap();
            files.insert(format!("{folder}/{name}"));
        }
    }
    let ours = interfaces().filter_map(|name| {
        let (folder, name) = name.strip_prefix("teleclay_msgs/")?.split_once('/')?;
        Some(format!("{folder}/{name}.{folder}"))
    });
    assert_eq!(files, ours.collect());
    let list = std::fs::read_to_string(format!("{package}/CMakeLists.txt")).unwrap();
    let listed = list
        .lines()
        .filter_map(|line| line.trim().strip_prefix('"'));
    let listed = listed.map(|line| line.trim_end_matches('"').to_owned());
    assert_eq!(files, listed.collect());
    for file in files.iter().filter(|file| file.starts_with("msg/")) {
        let name = file.trim_start_matches("msg/").trim_end_matches(".msg");
        let text = std::fs::read_to_string(format!("{package}/{file}")).unwrap();
        let told = definition(&format!("teleclay_msgs/msg/{name}")).unwrap();
        assert!(told.starts_with(&text), "{file}");
    }
}
