//! The closed forms: points and bearings in, at most four candidate poses out. No refinement, no choice.
//!
//! | solver | points | candidates | source |
//! | --- | --- | --- | --- |
//! | [`line_plus_one`] | 3 collinear + 1 off the line | 2 | own, docs/math/line_plus_one.md |
//! | [`wang2004`] | 3 collinear + 1 off the line | 4 | F.-Y. Wang, IEEE T-RA 2004, as printed |
//! | [`p3p`] | 3 | ≤ 4, all reproject, in front | own, docs/math/p3p.md |
//! | [`upright_p2p`] | 2, and the vertical | ≤ 2, in front | own, docs/math/upright_p2p.md |
//! | [`pure_rotation`] | ≥ 2 directions | 1 rotation | own, docs/math/pure_rotation.md |
//! | [`vanishing`] | ≥ 2 parallel lines; ≥ 2 line directions | 1 direction; ≤ 4 rotations | own, docs/math/lines.md |
//! | [`line_rotation`] | 3 lines | ≤ 8 rotations | own, docs/math/lines.md |
//! | [`gp3p`] | 3 rays of a rig | ≤ 8, all reproject, in front | own, docs/math/gp3p.md |
//! | [`upright_gp2p`] | 2 rays of a rig, gravity known | ≤ 2, all reproject, in front | own, docs/math/upright_gp2p.md |
//! | [`planar`] | ≥ 4 in a plane | 2 (1 face on) | own, docs/math/planar.md |
//! | [`sqpnp`] | ≥ 3 | ≤ 4 minima, best first | own descent on the cost of Terzakis and Lourakis 2020, docs/math/sqpnp.md |
//! | [`p4pf`] | 4, focal length unknown | ≤ 4, best first | own, docs/math/focal.md |
//! | [`p35pf`] | 3 and one coordinate of a 4th, focal length unknown | ≤ 10, all reproject, in front | own, docs/math/focal.md |
//! | [`p5pf`] | 5, focal length unknown | ≤ 4, best first | own, docs/math/focal.md |
//!
//! [`configuration`] decides beforehand which of them the points allow.

pub mod configuration;
pub mod line_plus_one;
pub mod wang2004;
pub mod p3p;
pub mod upright_p2p;
pub mod pure_rotation;
pub mod vanishing;
pub mod line_rotation;
pub mod gp3p;
pub mod upright_gp2p;
pub mod sqpnp;
pub mod planar;
pub mod unknown_focal;
pub mod p4pf;
pub mod p5pf;
mod p35pf_action;
pub mod p35pf;

use crate::Pose;
use arrayvec::ArrayVec;

/// Candidate poses `cam_from_target`, on the stack; no order promised.
pub type Candidates = ArrayVec<Pose, 4>;
