//! Cameras and band responses. A sensor knows no ray tracer and no radiance: it says where a pixel looks and how a band
//! weighs wavelengths.

mod band;
mod band_set;
mod camera;
mod frame_camera;
mod orthographic;
mod pose;
mod response_file;

pub use band::{Band, BandError};
pub use band_set::{band_set, band_sets};
pub use camera::{Camera, CameraError, CameraRay};
pub use frame_camera::{FrameCamera, Optics};
pub use orthographic::{Extent, Orthographic};
pub use pose::{FramePose, Standoff};
pub use response_file::{BandResponse, ResponseError, read_response_csv};
