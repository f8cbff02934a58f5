//! Local north-east metres about the rest point to WGS 84 latitude and longitude, by way of the earth's centre.

use nalgebra::Vector3;

use crate::findings::RestPose;
use crate::wgs84::Geodetic;

/// The tangent plane at the rest point (height 0 on the ellipsoid).
#[derive(Clone, Copy, Debug)]
pub struct TangentPlane {
    origin: Geodetic,
}

impl TangentPlane {
    /// The plane that touches the ellipsoid at the rest pose.
    #[must_use]
    pub fn at(pose: &RestPose) -> Self {
        Self {
            origin: on_ground(pose.latitude_deg, pose.longitude_deg),
        }
    }

    /// Longitude and latitude, degrees (`GeoJSON`'s order), of a point `north`, `east` metres from the origin.
    #[must_use]
    pub fn lon_lat(&self, north: f64, east: f64) -> [f64; 2] {
        let place = self.origin.moved(&Vector3::new(north, east, 0.0));
        [place.longitude.to_degrees(), place.latitude.to_degrees()]
    }

    /// North and east of the origin, m, of a latitude and longitude in degrees (height 0): the inverse of
    /// [`Self::lon_lat`] to 2 mm within 5 km.
    #[must_use]
    pub fn north_east(&self, latitude_deg: f64, longitude_deg: f64) -> [f64; 2] {
        let ned = self.origin.to(&on_ground(latitude_deg, longitude_deg));
        [ned.x, ned.y]
    }
}

fn on_ground(latitude_deg: f64, longitude_deg: f64) -> Geodetic {
    Geodetic {
        latitude: latitude_deg.to_radians(),
        longitude: longitude_deg.to_radians(),
        height: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::TangentPlane;
    use crate::findings::RestPose;
    use crate::wgs84::{A, E2};

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
