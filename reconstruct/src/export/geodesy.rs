//! Local north-east metres about the rest point to WGS 84 latitude and longitude, by way of the earth's centre.

use crate::findings::RestPose;

/// Semi-major axis of WGS 84, m.
const A: f64 = 6_378_137.0;
/// Flattening of WGS 84.
const F: f64 = 1.0 / 298.257_223_563;
/// First eccentricity squared.
const E2: f64 = F * (2.0 - F);

/// The tangent plane at the rest point (height 0 on the ellipsoid).
#[derive(Clone, Copy, Debug)]
pub struct TangentPlane {
    latitude: f64,
    longitude: f64,
    origin: [f64; 3],
}

impl TangentPlane {
    /// The plane that touches the ellipsoid at the rest pose.
    #[must_use]
    pub fn at(pose: &RestPose) -> Self {
        let (latitude, longitude) = (
            pose.latitude_deg.to_radians(),
            pose.longitude_deg.to_radians(),
        );
        Self {
            latitude,
            longitude,
            origin: earth_centred(latitude, longitude),
        }
    }

    /// Longitude and latitude, degrees (`GeoJSON`'s order), of a point `north`, `east` metres from the origin.
    #[must_use]
    pub fn lon_lat(&self, north: f64, east: f64) -> [f64; 2] {
        let (sin_lat, cos_lat) = self.latitude.sin_cos();
        let (sin_lon, cos_lon) = self.longitude.sin_cos();
        let x = self.origin[0] - sin_lat * cos_lon * north - sin_lon * east;
        let y = self.origin[1] - sin_lat * sin_lon * north + cos_lon * east;
        let z = self.origin[2] + cos_lat * north;
        let p = x.hypot(y);
        // Bowring's formula; exact to well below a millimetre at the surface, one step suffices.
        let b = A * (1.0 - F);
        let second = E2 / (1.0 - E2);
        let (s, c) = (z * A).atan2(p * b).sin_cos();
        let latitude = (z + second * b * s.powi(3)).atan2(p - E2 * A * c.powi(3));
        [y.atan2(x).to_degrees(), latitude.to_degrees()]
    }

    /// North and east of the origin, m, of a latitude and longitude in degrees (height 0): the inverse of
    /// [`Self::lon_lat`] to 2 mm within 5 km.
    #[must_use]
    pub fn north_east(&self, latitude_deg: f64, longitude_deg: f64) -> [f64; 2] {
        let (sin_lat, cos_lat) = self.latitude.sin_cos();
        let (sin_lon, cos_lon) = self.longitude.sin_cos();
        let point = earth_centred(latitude_deg.to_radians(), longitude_deg.to_radians());
        let [x, y, z] = [0, 1, 2].map(|i| point[i] - self.origin[i]);
        let outward = cos_lon * x + sin_lon * y;
        [cos_lat * z - sin_lat * outward, cos_lon * y - sin_lon * x]
    }
}

fn earth_centred(latitude: f64, longitude: f64) -> [f64; 3] {
    let (sin_lat, cos_lat) = latitude.sin_cos();
    let n = A / (1.0 - E2 * sin_lat * sin_lat).sqrt();
    [
        n * cos_lat * longitude.cos(),
        n * cos_lat * longitude.sin(),
        n * (1.0 - E2) * sin_lat,
    ]
}

#[cfg(test)]
mod tests {
    use super::{A, E2, TangentPlane};
    use crate::findings::RestPose;

    fn plane(lat: f64, lon: f64) -> TangentPlane {
        TangentPlane::at(&RestPose {
            latitude_deg: lat,
            longitude_deg: lon,
            heading_deg: 0.0,
            sd_m: 0.0,
            sd_deg: 0.0,
        })
    }

    #[test]
    fn origin_maps_to_itself_and_metres_follow_the_radii_of_curvature() {
        for (lat, lon) in [
            (59.91_f64, 10.75_f64),
            (-33.86, 151.21),
            (0.0, -78.5),
            (78.2, 179.999_9),
        ] {
            let plane = plane(lat, lon);
            let [lon0, lat0] = plane.lon_lat(0.0, 0.0);
            assert!((lat0 - lat).abs() < 1e-10 && (lon0 - lon).abs() < 1e-10);
            let w = 1.0 - E2 * lat.to_radians().sin().powi(2);
            let meridian = A * (1.0 - E2) / w.powf(1.5);
            let parallel = A / w.sqrt() * lat.to_radians().cos();
            let [_, lat1] = plane.lon_lat(100.0, 0.0);
            assert!(((lat1 - lat).to_radians() * meridian - 100.0).abs() < 1e-3);
            let [lon1, _] = plane.lon_lat(0.0, 100.0);
            let [lon2, lat2] = plane.lon_lat(-3200.0, 3700.0);
            let [north, east] = plane.north_east(lat2, lon2);
            assert!((north + 3200.0).abs() < 3e-3 && (east - 3700.0).abs() < 3e-3);
            let turned = (lon1 - lon + 540.0).rem_euclid(360.0) - 180.0;
            assert!((turned.to_radians() * parallel - 100.0).abs() < 1e-3);
        }
    }
}
