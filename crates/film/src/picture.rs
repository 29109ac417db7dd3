//! A picture with everything that is known of its pixels.

use base::{Grid, ImageSize, Rgb, Window};

/// Named channels of one size, and a text about how they were made.
///
/// A channel of a layer is called `LAYER.CHANNEL`, as in `direct.R`; the beauty is `R`, `G` and `B`.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    window: Window,
    metadata: String,
    channels: Vec<(String, Vec<f32>)>,
}

impl Picture {
    /// A picture without channels. `metadata` is one JSON value, or empty.
    pub fn new(size: ImageSize, metadata: String) -> Self {
        Self::part(Window::whole(size), metadata)
    }

    /// As [`Picture::new`], a part of a picture. `metadata` is that of the whole.
    pub fn part(window: Window, metadata: String) -> Self {
        Self { window, metadata, channels: Vec::new() }
    }

    /// Width and height.
    pub fn size(&self) -> ImageSize {
        self.window.size
    }

    /// Where it lies in the picture that it is a part of.
    pub fn window(&self) -> Window {
        self.window
    }

    /// The JSON text the picture was made with; empty if it has none.
    pub fn metadata(&self) -> &str {
        &self.metadata
    }

    /// The channels with their values in row-major order, in the order in which they were added.
    pub fn channels(&self) -> impl Iterator<Item = (&str, &[f32])> {
        self.channels.iter().map(|(name, values)| (name.as_str(), values.as_slice()))
    }

    /// The values of a channel in row-major order.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels().find(|(n, _)| *n == name).map(|(_, values)| values)
    }

    /// Adds a channel, its values in row-major order.
    ///
    /// # Panics
    /// When there are not as many values as pixels, or when there is a channel of that name.
    pub fn push(&mut self, name: impl Into<String>, values: Vec<f32>) {
        let name = name.into();
        assert_eq!(values.len(), self.size().n_pixels(), "channel {name} needs a value per pixel");
        assert!(self.channel(&name).is_none(), "channel {name} is there already");
        self.channels.push((name, values));
    }

    /// Adds the channels `R`, `G` and `B` of a layer; the layer `""` is the beauty.
    ///
    /// # Panics
    /// When `values` is of another size, or when the layer is there already.
    pub fn push_rgb(&mut self, layer: &str, values: &Grid<Rgb>) {
        assert_eq!(values.size(), self.size(), "layer {layer:?} needs the size of the picture");
        let take = |f: fn(&Rgb) -> f32| values.values().iter().map(f).collect();
        let [r, g, b] = rgb_names(layer);
        self.push(r, take(|c| c.r));
        self.push(g, take(|c| c.g));
        self.push(b, take(|c| c.b));
    }

    /// The channels `R`, `G` and `B` of a layer, if it has all three; the layer `""` is the beauty.
    pub fn rgb(&self, layer: &str) -> Option<Grid<Rgb>> {
        let [r, g, b] = rgb_names(layer);
        let (r, g, b) = (self.channel(&r)?, self.channel(&g)?, self.channel(&b)?);
        let values = r.iter().zip(g).zip(b).map(|((&r, &g), &b)| Rgb::new(r, g, b)).collect();
        Some(Grid::from_values(self.size(), values))
    }
}

/// The names of the three channels of a layer.
pub(crate) fn rgb_names(layer: &str) -> [String; 3] {
    ["R", "G", "B"].map(|channel| match layer {
        "" => channel.into(),
        _ => format!("{layer}.{channel}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_come_back() {
        let size = ImageSize { width: 3, height: 2 };
        let beauty = Grid::from_fn(size, |p| Rgb::new(p.x as f32, p.y as f32, 0.5));
        let direct = Grid::from_fn(size, |p| Rgb::splat(p.x as f32 * 2.0));
        let mut picture = Picture::new(size, String::new());
        picture.push_rgb("direct", &direct);
        picture.push_rgb("", &beauty);
        picture.push("Z", vec![1.0; 6]);
        assert_eq!(picture.rgb(""), Some(beauty));
        assert_eq!(picture.rgb("direct"), Some(direct));
        assert_eq!(picture.rgb("indirect"), None);
        assert_eq!(picture.channel("B"), Some([0.5; 6].as_slice()));
        let names: Vec<_> = picture.channels().map(|(name, _)| name).collect();
        assert_eq!(names, ["direct.R", "direct.G", "direct.B", "R", "G", "B", "Z"]);
    }
}
