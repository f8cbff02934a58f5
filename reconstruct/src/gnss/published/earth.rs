//! ECEF and geographic coordinates, and rotations about one axis.

use nalgebra::{Matrix3, Vector3};

use super::constants::RADIUS;
use super::variant::{Reading, Source};
use crate::wgs84;

/// The Earth by its two half axes; the program hands in the same radius for both [S00, 6.5].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Earth {
    /// Equatorial half axis, m.
    pub a: f64,
    /// Polar half axis, m.
    pub b: f64,
}

impl Earth {
    /// The source's sphere, or WGS 84.
    ///
    /// On the sphere a metre is too many degrees: receivers give the latitude of the ellipsoid, whose radii of
    /// curvature at 63.4 degrees north exceed 6,371 km by 0.25 % northward and 0.38 % eastward.
    #[must_use]
    pub fn of(reading: Reading) -> Self {
        match reading {
            Reading::Published => Self {
                a: RADIUS,
                b: RADIUS,
            },
            Reading::Corrected => Self {
                a: wgs84::A,
                b: wgs84::A * (1.0 - wgs84::F),
            },
        }
    }

    /// First eccentricity squared.
    fn e2(&self) -> f64 {
        1.0 - (self.b / self.a).powi(2)
    }

    /// ECEF position, m, of latitude and longitude (rad) and height (m): the program's `geod2ECEF`.
    #[must_use]
    pub fn ecef(&self, lat: f64, lon: f64, height: f64) -> Vector3<f64> {
        let (s, c) = lat.sin_cos();
        let n = self.a / (1.0 - self.e2() * s * s).sqrt();
        Vector3::new(
            (n + height) * c * lon.cos(),
            (n + height) * c * lon.sin(),
            (n * (1.0 - self.e2()) + height) * s,
        )
    }

    /// Latitude and longitude (rad) and height (m) of an ECEF position, m: the program's `ECEF2geod`.
    ///
    /// On a sphere exact; else two steps of Bowring's formula, exact to rounding from the sea floor to orbit.
    #[must_use]
    pub fn geodetic(&self, r: &Vector3<f64>) -> [f64; 3] {
        let p = (r.x * r.x + r.y * r.y).sqrt();
        let lon = r.y.atan2(r.x);
        if self.e2() == 0.0 {
            return [r.z.atan2(p), lon, (p * p + r.z * r.z).sqrt() - self.a];
        }
        let second = (self.a / self.b).powi(2) - 1.0;
        let mut reduced = (r.z * self.a).atan2(p * self.b);
        let mut lat = 0.0;
        for _ in 0..2 {
            let (s, c) = reduced.sin_cos();
            lat = (r.z + second * self.b * s.powi(3)).atan2(p - self.e2() * self.a * c.powi(3));
            let (s, c) = lat.sin_cos();
            reduced = (self.b * s).atan2(self.a * c);
        }
        let (s, c) = lat.sin_cos();
        let height = p * c + r.z * s - self.a * (1.0 - self.e2() * s * s).sqrt();
        [lat, lon, height]
    }
}

impl Earth {
    /// Latitude and longitude (rad) and height (m) of an ECEF position, m, and [`ecef_to_geographic`] there; on a
    /// sphere the matrix comes from the position's ratios, without a sine.
    #[must_use]
    pub fn local(&self, r: &Vector3<f64>) -> ([f64; 3], Matrix3<f64>) {
        let place = self.geodetic(r);
        let p = (r.x * r.x + r.y * r.y).sqrt();
        let n = (p * p + r.z * r.z).sqrt();
        if self.e2() == 0.0 && p > 0.0 {
            return (place, axes(r.z / n, p / n, r.y / p, r.x / p));
        }
        (place, ecef_to_geographic(place[0], place[1]))
    }
}

/// The matrix of [S00, 2.4], 3 x 3: rows north, east, down in ECEF axes. It takes ECEF to geographic axes and the
/// program uses its transpose for the other way; the text says it is the other way itself.
#[must_use]
pub fn ecef_to_geographic(lat: f64, lon: f64) -> Matrix3<f64> {
    let (sp, cp) = lat.sin_cos();
    let (sl, cl) = lon.sin_cos();
    axes(sp, cp, sl, cl)
}

/// [`ecef_to_geographic`] of the sines and cosines of latitude and longitude.
fn axes(sp: f64, cp: f64, sl: f64, cl: f64) -> Matrix3<f64> {
    Matrix3::new(
        -sp * cl,
        -sp * sl,
        cp,
        -sl,
        cl,
        0.0,
        -cp * cl,
        -cp * sl,
        -sp,
    )
}

/// Sense of the rotations: the program's turn the vector, (2.1) to (2.3) as printed turn the axes.
fn sine(angle: f64, sense: Source) -> f64 {
    match sense {
        Source::Program => angle.sin(),
        Source::Text => -angle.sin(),
    }
}

/// Rotation about x by `angle` (rad), 3 x 3 [S00, 2.1], in the program's sense or as printed.
#[must_use]
pub fn rx(angle: f64, sense: Source) -> Matrix3<f64> {
    let (s, c) = (sine(angle, sense), angle.cos());
    Matrix3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c)
}

/// Rotation about y by `angle` (rad), 3 x 3 [S00, 2.2], in the program's sense or as printed.
#[must_use]
pub fn ry(angle: f64, sense: Source) -> Matrix3<f64> {
    let (s, c) = (sine(angle, sense), angle.cos());
    Matrix3::new(c, 0.0, s, 0.0, 1.0, 0.0, -s, 0.0, c)
}

/// Rotation about z by `angle` (rad), 3 x 3 [S00, 2.3], in the program's sense or as printed.
#[must_use]
pub fn rz(angle: f64, sense: Source) -> Matrix3<f64> {
    let (s, c) = (sine(angle, sense), angle.cos());
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}
