//! The parts that every alignment of surfaces is made of: correspondences with robust weights are summed into normal
//! equations, one body is laid onto others step by step, and all poses are solved for at once.

pub mod descent;
pub mod normal_equations;
pub mod pose_system;
pub mod robust_kernel;
