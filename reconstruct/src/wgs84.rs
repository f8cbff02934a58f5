//! The ellipsoid WGS 84: geodetic places, the Earth-centred frame, and local north-east-down frames between them.

use nalgebra::{Matrix3, Vector3};

/// Semi-major axis, m.
pub const A: f64 = 6_378_137.0;
/// Flattening.
pub const F: f64 = 1.0 / 298.257_223_563;
/// First eccentricity squared.
pub const E2: f64 = F * (2.0 - F);

/// A place on or above the ellipsoid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geodetic {
    /// Latitude, rad, north positive.
    pub latitude: f64,
    /// Longitude, rad, east positive.
    pub longitude: f64,
    /// Height above the ellipsoid, m.
    pub height: f64,
}

impl Geodetic {
    /// Earth-centred, Earth-fixed coordinates, m.
    #[must_use]
    pub fn ecef(&self) -> Vector3<f64> {
        let (s, c) = self.latitude.sin_cos();
        let n = A / (1.0 - E2 * s * s).sqrt();
        let flat = (n + self.height) * c;
        Vector3::new(
            flat * self.longitude.cos(),
            flat * self.longitude.sin(),
            (n * (1.0 - E2) + self.height) * s,
        )
    }

    /// From Earth-centred coordinates, m; Bowring's formula twice, exact to a micrometre from 10 km below to
    /// 100 km above the ellipsoid. At the Earth's centre, which has no latitude, NaN.
    #[must_use]
    pub fn from_ecef(r: &Vector3<f64>) -> Self {
        let p = r.x.hypot(r.y);
        let b = A * (1.0 - F);
        let second = E2 / (1.0 - E2);
        let mut reduced = (r.z * A).atan2(p * b);
        let mut latitude = 0.0;
        for _ in 0..2 {
            let (s, c) = reduced.sin_cos();
            latitude = (r.z + second * b * s.powi(3)).atan2(p - E2 * A * c.powi(3));
            reduced = ((1.0 - F) * latitude.sin()).atan2(latitude.cos());
        }
        let (s, c) = latitude.sin_cos();
        let height = p * c + r.z * s - A * (1.0 - E2 * s * s).sqrt();
        Self {
            latitude,
            longitude: r.y.atan2(r.x),
            height,
        }
    }

    /// Rotation from the local north-east-down axes to Earth-centred ones [S00, 2.4 transposed, with latitude and
    /// longitude in the places that its list of symbols gives them].
    #[must_use]
    pub fn c_en(&self) -> Matrix3<f64> {
        let (sp, cp) = self.latitude.sin_cos();
        let (sl, cl) = self.longitude.sin_cos();
        Matrix3::new(
            -sp * cl,
            -sl,
            -cp * cl,
            -sp * sl,
            cl,
            -cp * sl,
            cp,
            0.0,
            -sp,
        )
    }

    /// North, east and down from here to `other`, m, in the axes here: straight lines, not arcs.
    #[must_use]
    pub fn to(&self, other: &Self) -> Vector3<f64> {
        self.c_en().transpose() * (other.ecef() - self.ecef())
    }

    /// The place that lies `ned` metres (north, east, down, in the axes here) away.
    #[must_use]
    pub fn moved(&self, ned: &Vector3<f64>) -> Self {
        Self::from_ecef(&(self.ecef() + self.c_en() * ned))
    }

    /// Rotation from the local axes of `from` to the local axes here.
    #[must_use]
    pub fn turn_from(&self, from: &Self) -> Matrix3<f64> {
        self.c_en().transpose() * from.c_en()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(lat: f64, lon: f64, height: f64) -> Geodetic {
        Geodetic {
            latitude: lat.to_radians(),
            longitude: lon.to_radians(),
            height,
        }
    }

    #[test]
    fn there_and_back() {
        for lat in [-89.999, -63.4, -1.0, 0.0, 33.0, 63.43, 90.0] {
            for (lon, height) in [(10.4, 0.0), (-179.99, 8_000.0), (0.0, -400.0), (121.0, 1e5)] {
                let from = place(lat, lon, height);
                let back = Geodetic::from_ecef(&from.ecef());
                assert!((back.ecef() - from.ecef()).norm() < 1e-6, "{lat} {lon}");
                assert!((back.latitude - from.latitude).abs() < 1e-12);
                assert!((back.height - height).abs() < 1e-6);
            }
        }
    }

    /// A degree of latitude at 45 degrees is 111,132 m, of longitude 78,847 m (published lengths, WGS 84).
    #[test]
    fn degrees_have_their_lengths() {
        let at = place(45.0, 10.0, 0.0);
        let north = place(44.5, 10.0, 0.0).to(&place(45.5, 10.0, 0.0)).norm();
        assert!((north - 111_132.0).abs() < 3.0, "{north}");
        let east = at.to(&place(45.0, 10.001, 0.0)).y * 1000.0;
        assert!((east - 78_847.0).abs() < 1.0, "{east}");
    }

    #[test]
    fn moved_undoes_to_and_axes_turn_with_the_place() {
        let from = place(63.43, 10.4, 120.0);
        let ned = Vector3::new(300.0, -1200.0, 15.0);
        let there = from.moved(&ned);
        assert!((from.to(&there) - ned).norm() < 1e-6);
        // A kilometre east at 63 degrees turns north by tan(latitude)/radius a metre.
        let turn = place(63.43, 10.4, 0.0)
            .moved(&Vector3::new(0.0, 1000.0, 0.0))
            .turn_from(&place(63.43, 10.4, 0.0));
        let convergence = turn.m12.atan2(turn.m11);
        let radius = A / (1.0 - E2 * 63.43_f64.to_radians().sin().powi(2)).sqrt();
        assert!(
            (convergence + 1000.0 * 63.43_f64.to_radians().tan() / radius).abs() < 1e-7,
            "{convergence}"
        );
    }
}
