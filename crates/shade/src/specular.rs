//! Specular light: what mirrors, metals and glass show.

use base::Rgb;

use crate::{PixelStream, Shader, ShadingPoint, Work};

impl Shader<'_> {
    /// Radiance of the second term of Eq. (8): any light, scattered specularly. At the ends of the chains the other three
    /// components are computed as for the eye itself.
    pub fn specular(&self, at: &ShadingPoint<'_>, stream: PixelStream, work: &mut Work) -> Rgb {
        if !at.material.is_specular() {
            return Rgb::BLACK;
        }
        let mut sum = Rgb::BLACK;
        self.chain(at, stream, work, |leaf, work| {
            let Some(point) = &leaf.point else {
                sum += self.background() * leaf.weight;
                return;
            };
            sum += point.emitted() * leaf.weight;
            if let Some(weight) = leaf.diffuse_weight {
                let direct = self.direct(point, leaf.stream, work);
                sum += (direct + self.indirect(point, work) + self.caustic(point, work)) * weight;
            }
        });
        sum
    }
}
