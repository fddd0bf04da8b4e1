//! Files appear whole or not at all.

// The exception for tests covers only the test functions themselves, not their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use std::io::Write;
use std::path::Path;

use tercel_data::table::{Detections, Tracks};
use tercel_data::{AtomicFile, TracksWriter, write_detections};

fn names(folder: &Path) -> Vec<String> {
    std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn an_unfinished_file_leaves_the_old_one_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tracks.csv");
    std::fs::write(&path, "old").unwrap();
    let mut file = AtomicFile::create(&path).unwrap();
    file.write_all(b"half").unwrap();
    drop(file);
    let head = Tracks { labels: vec!["x".to_owned(), "y".to_owned()], ..Tracks::default() };
    drop(TracksWriter::create(&path, &head).unwrap());
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    assert_eq!(names(folder.path()), ["tracks.csv"]);
}

#[test]
fn a_finished_file_replaces_the_old_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("radar.csv");
    std::fs::write(&path, "old").unwrap();
    write_detections(&path, &Detections::default()).unwrap();
    assert!(std::fs::read_to_string(&path).unwrap().starts_with("# tercel: "));
    assert_eq!(names(folder.path()), ["radar.csv"]);
}

#[cfg(unix)]
mod unix {
    use super::*;
    use std::os::unix::fs::{PermissionsExt, symlink};

    #[test]
    fn a_file_has_the_rights_of_any_new_file_or_of_the_one_before() {
        let folder = tempfile::tempdir().unwrap();
        let mode = |name: &str| folder.path().join(name).metadata().unwrap().permissions().mode() & 0o777;
        std::fs::write(folder.path().join("plain"), "").unwrap();
        write_detections(folder.path().join("new.csv"), &Detections::default()).unwrap();
        assert_eq!(mode("new.csv"), mode("plain"));
        std::fs::set_permissions(folder.path().join("new.csv"), PermissionsExt::from_mode(0o640)).unwrap();
        write_detections(folder.path().join("new.csv"), &Detections::default()).unwrap();
        assert_eq!(mode("new.csv"), 0o640);
    }

    #[test]
    fn a_link_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let (target, link) = (folder.path().join("target.csv"), folder.path().join("link.csv"));
        std::fs::write(&target, "old").unwrap();
        symlink(&target, &link).unwrap();
        write_detections(&link, &Detections::default()).unwrap();
        assert!(link.symlink_metadata().unwrap().is_symlink());
        assert!(std::fs::read_to_string(&target).unwrap().starts_with("# tercel: "));
    }

    #[test]
    fn a_device_is_written_and_stays_a_device() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("null.csv");
        symlink("/dev/null", &link).unwrap();
        write_detections(&link, &Detections::default()).unwrap();
        assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
    }
}
