//! Where are the others: tracks of many targets in clutter, seen from an uncertain own ship.
//!
//! | file | what is in it |
//! |---|---|
//! | [`own_ship`] | the own ship's pose with its covariance, and how fast its errors are forgotten |
//! | [`detection`] | what radar, camera and AIS report; predicted measurement and Jacobians |
//! | [`coordinated_turn`] | motion in a circle, its Jacobian; constant velocity in the same states |
//! | [`imm`] | several motion models at once, with the cross-covariance to the own ship |
//! | [`association`] | gates, PDA, IPDA, JIPDA |
//! | [`multi_target`] | the tracker: initiation, existence, confirmation, deletion |

pub mod association;
pub mod coordinated_turn;
pub mod detection;
pub mod imm;
pub mod multi_target;
pub mod own_ship;
