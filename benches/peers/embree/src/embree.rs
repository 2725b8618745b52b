//! The few functions of Embree 3 that the comparison needs (`rtcore.h` of 3.13).

use glam::DVec3;
use std::ffi::c_void;
use sunglint_geometry::Ray;

#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct RtcRay {
    org: [f32; 3],
    tnear: f32,
    dir: [f32; 3],
    time: f32,
    tfar: f32,
    mask: u32,
    id: u32,
    flags: u32,
}

#[repr(C, align(16))]
#[derive(Clone, Copy)]
struct RtcHit {
    normal: [f32; 3],
    u: f32,
    v: f32,
    primitive: u32,
    geometry: u32,
    instance: u32,
}

#[repr(C, align(16))]
struct RtcRayHit {
    ray: RtcRay,
    hit: RtcHit,
}

#[repr(C)]
struct Context {
    flags: u32,
    filter: *const c_void,
    instance: u32,
}

#[link(name = "embree3")]
unsafe extern "C" {
    fn rtcNewDevice(config: *const i8) -> *mut c_void;
    fn rtcReleaseDevice(device: *mut c_void);
    fn rtcNewScene(device: *mut c_void) -> *mut c_void;
    fn rtcReleaseScene(scene: *mut c_void);
    fn rtcSetSceneFlags(scene: *mut c_void, flags: u32);
    fn rtcCommitScene(scene: *mut c_void);
    fn rtcNewGeometry(device: *mut c_void, kind: u32) -> *mut c_void;
    fn rtcReleaseGeometry(geometry: *mut c_void);
    fn rtcSetNewGeometryBuffer(
        geometry: *mut c_void,
        kind: u32,
        slot: u32,
        format: u32,
        stride: usize,
        count: usize,
    ) -> *mut c_void;
    fn rtcCommitGeometry(geometry: *mut c_void);
    fn rtcAttachGeometry(scene: *mut c_void, geometry: *mut c_void) -> u32;
    fn rtcIntersect1(scene: *mut c_void, context: *mut Context, ray: *mut RtcRayHit);
    fn rtcOccluded1(scene: *mut c_void, context: *mut Context, ray: *mut RtcRay);
}

const TRIANGLES: u32 = 0;
const INDEX_BUFFER: u32 = 0;
const VERTEX_BUFFER: u32 = 1;
const UINT3: u32 = 0x5003;
const FLOAT3: u32 = 0x9003;
const ROBUST: u32 = 1 << 2;
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mode {
    Default,
    Robust,
}

pub struct Scene {
    device: *mut c_void,
    scene: *mut c_void,
}

impl Scene {
    pub fn new(corners: &[DVec3], triangles: &[[u32; 3]], mode: Mode) -> Self {
        // SAFETY: the buffers are Embree's own, of the sizes asked for, and filled before the commit.
        unsafe {
            let device = rtcNewDevice(c"threads=1,set_affinity=0".as_ptr().cast());
            let scene = rtcNewScene(device);
            rtcSetSceneFlags(scene, if mode == Mode::Robust { ROBUST } else { 0 });
            let geometry = rtcNewGeometry(device, TRIANGLES);
            let vertices = rtcSetNewGeometryBuffer(geometry, VERTEX_BUFFER, 0, FLOAT3, 12, corners.len());
            let vertices = std::slice::from_raw_parts_mut(vertices.cast::<[f32; 3]>(), corners.len());
            vertices.iter_mut().zip(corners).for_each(|(v, c)| *v = c.as_vec3().to_array());
            let indices = rtcSetNewGeometryBuffer(geometry, INDEX_BUFFER, 0, UINT3, 12, triangles.len());
            std::slice::from_raw_parts_mut(indices.cast::<[u32; 3]>(), triangles.len()).copy_from_slice(triangles);
            rtcCommitGeometry(geometry);
            rtcAttachGeometry(scene, geometry);
            rtcReleaseGeometry(geometry);
            rtcCommitScene(scene);
            Self { device, scene }
        }
    }

    pub fn closest(&self, ray: &Ray) -> bool {
        let hit = RtcHit { normal: [0.0; 3], u: 0.0, v: 0.0, primitive: NONE, geometry: NONE, instance: NONE };
        let mut both = RtcRayHit { ray: to_embree(ray), hit };
        let mut context = Context { flags: 0, filter: std::ptr::null(), instance: NONE };
        // SAFETY: the scene is committed, ray and context have Embree's layout and alignment.
        unsafe { rtcIntersect1(self.scene, &mut context, &mut both) };
        both.hit.geometry != NONE
    }

    pub fn occluded(&self, ray: &Ray) -> bool {
        let mut ray = to_embree(ray);
        let mut context = Context { flags: 0, filter: std::ptr::null(), instance: NONE };
        // SAFETY: as above.
        unsafe { rtcOccluded1(self.scene, &mut context, &mut ray) };
        ray.tfar < 0.0
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: both are live, and released once.
        unsafe {
            rtcReleaseScene(self.scene);
            rtcReleaseDevice(self.device);
        }
    }
}

fn to_embree(ray: &Ray) -> RtcRay {
    RtcRay {
        org: ray.origin.as_vec3().to_array(),
        // Our rays leave by an f64 bound, which f32 cannot hold.
        tnear: 1e-3,
        dir: ray.direction.vec().as_vec3().to_array(),
        time: 0.0,
        tfar: ray.t_max as f32,
        mask: NONE,
        id: 0,
        flags: 0,
    }
}
