//! Values that are none: a fault of the renderer or a scene beyond single precision, but never a picture.

use anyhow::bail;
use base::{Component, Components, Grid, Pixel, Rgb, Window};

/// Refuses a picture in which a component isn't a number somewhere in a window of subpixels, `n` of which make a side of a
/// pixel.
///
/// # Errors
/// Names each such component with its first pixel, what it is there, and the number of its subpixels.
pub(crate) fn check(values: &Components<Grid<Rgb>>, window: Window, n: u32) -> anyhow::Result<()> {
    let of_component = |component: Component| {
        let grid = &values[component];
        let bad = || grid.values().iter().enumerate().filter(|(_, color)| !color.is_finite());
        let (first, color) = bad().next()?;
        let Pixel { x, y } = window.in_whole(grid.size().pixel(first));
        let [r, g, b] = color.to_array();
        let others = match bad().count() - 1 {
            0 => String::new(),
            more => format!(", and no number at {more} more"),
        };
        Some(format!(
            "{component} light is ({r}, {g}, {b}) at pixel ({}, {}){others}",
            x / n,
            y / n
        ))
    };
    let faults: Vec<String> = Component::ALL.into_iter().filter_map(of_component).collect();
    if faults.is_empty() {
        return Ok(());
    }
    bail!(
        "no picture was written, since {}; look for lights that touch surfaces, or report it as a fault of the renderer",
        faults.join("; ")
    )
}

#[cfg(test)]
mod tests {
    use base::ImageSize;

    use super::*;

    #[test]
    fn what_is_no_number_is_located_and_counted() {
        let size = ImageSize { width: 6, height: 4 };
        let mut values = Components::from_fn(|_| Grid::from_fn(size, |_| Rgb::ONE));
        check(&values, Window::whole(size), 1).unwrap();
        values.indirect[Pixel { x: 4, y: 2 }].g = f32::NAN;
        values.caustic[Pixel { x: 5, y: 3 }].r = f32::INFINITY;
        values.caustic[Pixel { x: 1, y: 3 }].b = f32::NEG_INFINITY;
        assert_eq!(
            check(&values, Window::whole(size), 2).unwrap_err().to_string(),
            "no picture was written, since indirect light is (1, NaN, 1) at pixel (2, 1); caustic light is \
             (1, 1, -inf) at pixel (0, 1), and no number at 1 more; look for lights that touch surfaces, or report \
             it as a fault of the renderer"
        );
    }
}
