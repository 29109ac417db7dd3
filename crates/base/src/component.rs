//! The four light components of Eq. (8).

use std::fmt;
use std::ops::{Index, IndexMut};

use serde::{Deserialize, Serialize};

/// One term of Eq. (8). The order is the same everywhere: direct, indirect, specular, caustic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Component {
    /// Light straight from emitters, scattered diffusely.
    Direct,
    /// Light that was reflected diffusely at least once before, scattered diffusely.
    Indirect,
    /// Any light, scattered specularly.
    Specular,
    /// Light that came through specular bounces only, scattered diffusely (L S+ D).
    Caustic,
}

impl Component {
    /// All four, in order.
    pub const ALL: [Self; 4] = [Self::Direct, Self::Indirect, Self::Specular, Self::Caustic];

    /// The name used in file layers, statistics and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Direct => "direct",
            Self::Indirect => "indirect",
            Self::Specular => "specular",
            Self::Caustic => "caustic",
        }
    }
}

impl fmt::Display for Component {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One value per component: radiance, seconds, counts, flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Components<T> {
    /// See [`Component::Direct`].
    pub direct: T,
    /// See [`Component::Indirect`].
    pub indirect: T,
    /// See [`Component::Specular`].
    pub specular: T,
    /// See [`Component::Caustic`].
    pub caustic: T,
}

impl<T> Components<T> {
    /// `f` of each component, in order.
    pub fn from_fn(mut f: impl FnMut(Component) -> T) -> Self {
        Self {
            direct: f(Component::Direct),
            indirect: f(Component::Indirect),
            specular: f(Component::Specular),
            caustic: f(Component::Caustic),
        }
    }

    /// The four values with their components, in order.
    pub fn iter(&self) -> impl Iterator<Item = (Component, &T)> {
        Component::ALL.into_iter().map(|c| (c, &self[c]))
    }
}

impl<T> Index<Component> for Components<T> {
    type Output = T;
    #[inline]
    fn index(&self, c: Component) -> &T {
        match c {
            Component::Direct => &self.direct,
            Component::Indirect => &self.indirect,
            Component::Specular => &self.specular,
            Component::Caustic => &self.caustic,
        }
    }
}

impl<T> IndexMut<Component> for Components<T> {
    #[inline]
    fn index_mut(&mut self, c: Component) -> &mut T {
        match c {
            Component::Direct => &mut self.direct,
            Component::Indirect => &mut self.indirect,
            Component::Specular => &mut self.specular,
            Component::Caustic => &mut self.caustic,
        }
    }
}
