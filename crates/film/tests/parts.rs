//! Parts of pictures, and what they are joined to.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking, in its helpers too")]

use std::fs;
use std::path::Path;

use base::{Grid, ImageSize, Rng, Stream, Window};
use film::{
    Error, Existing, PackedRows, Part, Picture, assemble_exr, assemble_rgb, read_exr, write_exr,
    write_packed_exr,
};

const SIZE: ImageSize = ImageSize { width: 83, height: 71 };

/// Windows that fill the picture: none at a multiple of 16; bands, whose blocks are copied where they can be; both.
const WINDOWS: [&[[u32; 4]]; 3] = [
    &[[0, 30, 0, 50], [30, 83, 0, 17], [30, 83, 17, 50], [0, 7, 50, 71], [7, 83, 50, 71]],
    &[[0, 83, 0, 16], [0, 83, 16, 40], [0, 83, 40, 48], [0, 83, 48, 71]],
    &[[0, 83, 0, 32], [0, 40, 32, 64], [40, 83, 32, 64], [0, 83, 64, 71]],
];

/// Noise, which compression leaves as it is, and a gradient.
fn channels() -> Vec<(&'static str, Grid<f32>)> {
    let mut rng = Rng::new(0, Stream::Test, 0);
    let mut noise = || Grid::from_fn(SIZE, |_| rng.next_f32() - 0.5);
    let gradient = Grid::from_fn(SIZE, |p| p.x as f32 * 0.1);
    vec![("R", noise()), ("Z", noise()), ("G", noise()), ("B", gradient)]
}

fn picture(window: Window, metadata: &str) -> Picture {
    let mut picture = Picture::part(window, metadata.into());
    for (name, values) in channels() {
        picture.push(name, values.cut(Window::whole(SIZE), window).values().to_vec());
    }
    picture
}

fn write(path: &Path, bounds: [u32; 4], metadata: &str) {
    let window = Window::new(bounds, SIZE).unwrap();
    write_exr(path, Existing::Replace, &picture(window, metadata)).unwrap();
}

#[test]
fn parts_make_the_bytes_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for (metadata, windows) in ["", r#"{"seed":7,"part":null}"#, "{}"].into_iter().zip(WINDOWS) {
        let whole = picture(Window::whole(SIZE), metadata);
        write_exr(&at("whole.exr"), Existing::Replace, &whole).unwrap();
        let parts: Vec<Part> = (windows.iter().enumerate())
            .map(|(i, &bounds)| {
                let path = at(&format!("{i}.exr"));
                write(&path, bounds, metadata);
                let part = Part::open(&path).unwrap();
                assert_eq!(part.window().bounds(), bounds);
                assert_eq!((part.window().whole, part.metadata()), (SIZE, metadata));
                part
            })
            .rev()
            .collect();
        let bytes = assemble_exr(&at("joined.exr"), Existing::Replace, &parts).unwrap();
        let joined = fs::read(at("joined.exr")).unwrap();
        assert_eq!(joined.len() as u64, bytes);
        assert!(joined == fs::read(at("whole.exr")).unwrap());
        assert_eq!(assemble_rgb(&parts).unwrap(), whole.rgb("").unwrap());
        // A part is a picture for whoever wants to look at it.
        assert_eq!(read_exr(parts[0].path()).unwrap().size(), parts[0].window().size);
    }
}

/// A picture, and a part of one, that come in bands.
#[test]
fn bands_make_the_bytes_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    for window in [[0, 83, 0, 71], [7, 80, 5, 70]] {
        let window = Window::new(window, SIZE).unwrap();
        write_exr(&at("whole.exr"), Existing::Replace, &picture(window, "{}")).unwrap();
        let whole = fs::read(at("whole.exr")).unwrap();
        let [left, right, top, bottom] = window.bounds();
        for n_rows in [16, 48, 80] {
            let path = at("bands.exr");
            let band = |y: u32| {
                let bounds = [left, right, y, bottom.min(y + n_rows)];
                PackedRows::new(&path, &picture(Window::new(bounds, SIZE).unwrap(), "{}"))
            };
            let bands = (top..bottom).step_by(n_rows as usize).map(band);
            let written = write_packed_exr(&path, Existing::Replace, window, bands).unwrap();
            assert_eq!(written, whole.len() as u64);
            assert!(fs::read(&path).unwrap() == whole, "{n_rows} rows of {window:?}");
        }
    }
}

/// What a band comes with ends the file, and nothing is left of it.
#[test]
fn a_band_that_fails_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for n_good in [0, 1, 2] {
        let band = |i: u32| {
            let mut band = picture(Window::new([0, 83, i * 16, i * 16 + 16], SIZE).unwrap(), "{}");
            let value = if i < n_good { 0.0 } else { f32::NAN };
            band.push("late", vec![value; 83 * 16]);
            PackedRows::new(&path, &band)
        };
        let bands = (0..4).map(band);
        let whole = Window::whole(SIZE);
        let error = write_packed_exr(&path, Existing::Refuse, whole, bands).unwrap_err();
        let pixel = format!("late is NaN at pixel (0, {})", 16 * n_good);
        assert!(error.to_string().contains(&pixel), "{error}");
        assert!(fs::read_dir(folder.path()).unwrap().next().is_none());
    }
}

#[test]
fn damage_is_found_wherever_it_matters() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let bounds = [[0, 83, 0, 40], [0, 83, 40, 71]];
    write(&at("a.exr"), bounds[0], "{}");
    write(&at("b.exr"), bounds[1], "{}");
    let join = || {
        let parts = vec![Part::open(&at("a.exr"))?, Part::open(&at("b.exr"))?];
        let is_whole = parts[1].window().bounds() == bounds[1]
            && parts[1].window().whole == SIZE
            && parts[1].metadata() == "{}"
            && parts[1].names() == parts[0].names();
        // Parts that don't fit each other are refused before they are joined.
        if is_whole {
            assemble_exr(&at("joined.exr"), Existing::Replace, &parts).map(Some)
        } else {
            Ok(None)
        }
    };
    join().unwrap();
    let (good, whole) = (fs::read(at("b.exr")).unwrap(), fs::read(at("joined.exr")).unwrap());
    let mut n_found = 0;
    for i in (0..good.len()).step_by(61) {
        let mut bad = good.clone();
        bad[i] ^= 1 << (i % 8);
        fs::write(at("b.exr"), &bad).unwrap();
        fs::write(at("joined.exr"), "old").unwrap();
        match join() {
            // What nobody reads, such as the table of offsets, may be anything.
            Ok(Some(_)) => assert!(fs::read(at("joined.exr")).unwrap() == whole, "byte {i}"),
            Ok(None) => n_found += 1,
            Err(error) => {
                assert!(error.to_string().contains("b.exr"), "{error}");
                assert_eq!(fs::read(at("joined.exr")).unwrap(), b"old");
                n_found += 1;
            }
        }
    }
    assert!(n_found > good.len() / 61 * 9 / 10, "{n_found} of {}", good.len() / 61);
    for length in [0, 3, 100, good.len() / 2, good.len() - 1] {
        fs::write(at("b.exr"), &good[..length]).unwrap();
        assert!(join().unwrap_err().to_string().contains("b.exr"), "{length} bytes");
    }
}

#[test]
fn whole_pictures_are_no_parts() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    write_exr(&path, Existing::Refuse, &picture(Window::whole(SIZE), "{}")).unwrap();
    let error = Part::open(&path).unwrap_err();
    assert!(matches!(error, Error::NotAPart { .. }), "{error}");
    fs::write(&path, "text").unwrap();
    assert!(matches!(Part::open(&path).unwrap_err(), Error::NotExr { .. }));
    let error = Part::open(Path::new("none.exr")).unwrap_err();
    assert!(matches!(error, Error::Read { .. }));
}
