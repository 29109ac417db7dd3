//! Outputs appear whole or not at all.

use std::fs;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

use atomic_file::{Error, Existing, check, write};

#[test]
fn writes_a_new_file_with_ordinary_permissions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.map");
    for existing in [Existing::Refuse, Existing::Replace] {
        check(&path, existing).unwrap();
        let bytes = write(&path, existing, |out| {
            out.write_all(b"..cdef")?;
            out.seek(SeekFrom::Start(0))?;
            out.write_all(b"ab")
        });
        assert_eq!(bytes.unwrap(), 6);
        assert_eq!(fs::read(&path).unwrap(), b"abcdef");
        assert_eq!(names(folder.path()), ["a.map"]);

        let ordinary = folder.path().join("ordinary");
        fs::write(&ordinary, "").unwrap();
        let mode = |path| fs::metadata(path).unwrap().permissions();
        assert_eq!(mode(&path), mode(&ordinary));
        fs::remove_file(&ordinary).unwrap();
        fs::remove_file(&path).unwrap();
    }
}

#[test]
fn refuses_to_replace_unless_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.map");
    fs::write(&path, "old").unwrap();
    let message = format!("{} exists; give another name or --force to replace it", path.display());
    assert_eq!(check(&path, Existing::Refuse).unwrap_err().to_string(), message);
    let error = write(&path, Existing::Refuse, |_| panic!("must not start")).unwrap_err();
    assert_eq!(error.to_string(), message);
    assert_eq!(fs::read(&path).unwrap(), b"old");

    check(&path, Existing::Replace).unwrap();
    assert_eq!(write(&path, Existing::Replace, |out| out.write_all(b"newer")).unwrap(), 5);
    assert_eq!(fs::read(&path).unwrap(), b"newer");
    assert_eq!(names(folder.path()), ["a.map"]);
}

#[test]
fn refuses_a_file_that_came_into_being_meanwhile() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.map");
    let error = write(&path, Existing::Refuse, |out| {
        fs::write(&path, "someone else's")?;
        out.write_all(b"ours")
    });
    assert!(matches!(error, Err(Error::Exists { .. })), "{error:?}");
    assert_eq!(fs::read(&path).unwrap(), b"someone else's");
    assert_eq!(names(folder.path()), ["a.map"]);
}

#[test]
fn a_failure_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.map");
    let fail = |existing| {
        write(&path, existing, |out| {
            out.write_all(&[1; 100_000])?;
            Err(io::Error::other("a channel is missing"))
        })
    };
    let message = format!("cannot write {}: a channel is missing", path.display());
    assert_eq!(fail(Existing::Refuse).unwrap_err().to_string(), message);
    assert!(names(folder.path()).is_empty());

    fs::write(&path, "old").unwrap();
    assert_eq!(fail(Existing::Replace).unwrap_err().to_string(), message);
    assert_eq!(fs::read(&path).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["a.map"]);
}

#[test]
fn a_panic_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.map");
    let outcome = std::panic::catch_unwind(|| write(&path, Existing::Replace, |_| panic!("bug")));
    assert!(outcome.is_err());
    assert!(names(folder.path()).is_empty());
}

#[test]
fn names_that_cannot_be_files_are_refused_early() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("file"), "").unwrap();
    let refused = |name: &str| {
        let path = folder.path().join(name);
        let early = check(&path, Existing::Replace).unwrap_err();
        let late = write(&path, Existing::Replace, |_| panic!("must not start")).unwrap_err();
        assert_eq!(early.to_string(), late.to_string());
        early
    };
    for name in ["missing/a.map", "file/a.map"] {
        assert!(matches!(refused(name), Error::NoFolder { .. }), "{:?}", refused(name));
    }
    for name in ["", ".", "..", "new/"] {
        assert!(matches!(refused(name), Error::IsFolder { .. }), "{:?}", refused(name));
    }
    assert!(matches!(check(Path::new(""), Existing::Replace), Err(Error::NoName)));
    check(Path::new("a-name-without-a-folder"), Existing::Refuse).unwrap();
    assert_eq!(names(folder.path()), ["file"]);
}

#[cfg(unix)]
mod unix {
    use std::os::unix::fs::{PermissionsExt, symlink};

    use super::*;

    #[test]
    fn a_replaced_file_keeps_its_permissions() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("secret");
        fs::write(&path, "old").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        write(&path, Existing::Replace, |out| out.write_all(b"new")).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
    }

    #[test]
    fn a_folder_that_takes_no_files_is_refused_early() {
        let folder = tempfile::tempdir().unwrap();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o500)).unwrap();
        if fs::write(folder.path().join("probe"), "").is_ok() {
            return; // The superuser may write anywhere.
        }
        let path = folder.path().join("a.map");
        let message = format!("cannot create {}: permission denied", path.display());
        assert_eq!(check(&path, Existing::Refuse).unwrap_err().to_string(), message);
        let error = write(&path, Existing::Refuse, |_| panic!("must not start")).unwrap_err();
        assert_eq!(error.to_string(), message);
    }

    #[test]
    fn links_stay_and_what_they_point_to_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let store = folder.path().join("store");
        fs::create_dir(&store).unwrap();
        let link = folder.path().join("link");
        symlink("store/a.map", folder.path().join("middle")).unwrap();
        symlink("middle", &link).unwrap();

        // Nothing there yet.
        check(&link, Existing::Refuse).unwrap();
        write(&link, Existing::Refuse, |out| out.write_all(b"first")).unwrap();
        assert_eq!(fs::read(store.join("a.map")).unwrap(), b"first");
        // Now there is.
        assert!(matches!(check(&link, Existing::Refuse), Err(Error::Exists { .. })));
        write(&link, Existing::Replace, |out| out.write_all(b"second")).unwrap();
        assert_eq!(fs::read(store.join("a.map")).unwrap(), b"second");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(names(folder.path()), ["link", "middle", "store"]);
        assert_eq!(names(&store), ["a.map"]);

        let astray = folder.path().join("astray");
        symlink("missing/a.map", &astray).unwrap();
        assert!(matches!(check(&astray, Existing::Replace), Err(Error::NoFolder { .. })));
        let ring = folder.path().join("ring");
        symlink("ring", &ring).unwrap();
        assert!(matches!(check(&ring, Existing::Replace), Err(Error::Io { .. })));
    }

    #[test]
    fn a_full_device_is_an_error() {
        let path = Path::new("/dev/full");
        if !path.exists() {
            return; // Not every system has one.
        }
        assert!(matches!(check(path, Existing::Refuse), Err(Error::Exists { .. })));
        check(path, Existing::Replace).unwrap();
        for bytes in [1, 1_000_000] {
            let error =
                write(path, Existing::Replace, |out| out.write_all(&vec![7; bytes])).unwrap_err();
            assert!(
                error.to_string().starts_with("cannot write /dev/full: No space left on device"),
                "{error}"
            );
        }
        assert!(!fs::metadata(path).unwrap().is_file(), "the device was replaced");
    }

    #[test]
    fn a_pipe_gets_the_finished_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&path).status().unwrap();
        assert!(made.success());
        check(&path, Existing::Replace).unwrap();
        let reader = std::thread::spawn({
            let path = path.clone();
            move || fs::read(path).unwrap()
        });
        let bytes = write(&path, Existing::Replace, |out| {
            out.write_all(b"..cdef")?;
            out.seek(SeekFrom::Start(0))?;
            out.write_all(b"ab")
        });
        assert_eq!(bytes.unwrap(), 6);
        assert_eq!(reader.join().unwrap(), b"abcdef");
        assert_eq!(names(folder.path()), ["pipe"]);
    }
}

/// The names in a folder, sorted.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("the folder can be read");
    let name = |entry: io::Result<fs::DirEntry>| entry.map(|entry| entry.file_name());
    let mut names: Vec<_> = entries.map(name).collect::<Result<_, _>>().expect("so can its names");
    names.sort();
    names.into_iter().map(|name| name.into_string().expect("written here in UTF-8")).collect()
}
