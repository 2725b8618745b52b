//! Cameras, scanners, band responses and detectors. A sensor knows no ray tracer and no radiance: it says where a pixel
//! looks, how a band weighs wavelengths, and what a detector makes of a radiance.

mod band;
mod band_set;
mod camera;
mod detector;
mod flight;
mod frame_camera;
mod orthographic;
mod pose;
mod pushbroom;
mod response_file;
mod whiskbroom;

pub use band::{Band, BandError};
pub use band_set::{band_set, band_sets};
pub use camera::{Camera, CameraError, CameraRay, GroundMap};
pub use detector::{BUILTIN, Ccd, Draw};
pub use flight::{Flight, ScanPose};
pub use frame_camera::{FrameCamera, Optics};
pub use orthographic::{Extent, Orthographic};
pub use pose::{FramePose, Standoff};
pub use pushbroom::Pushbroom;
pub use response_file::{BandResponse, ResponseError, read_response_csv};
pub use whiskbroom::Whiskbroom;
