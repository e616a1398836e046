//! The filters as the application sees them: start at rest, step at 50 Hz, estimate, fingerprint.

mod axis_filters;
mod error_state;

pub use axis_filters::AxisNavigator;
pub use error_state::ErrorStateNavigator;
use northing_core::attitude::axis_filters::{AxisAngles, tilt_compensated_heading, tilt_of};
use northing_core::nalgebra::{ComplexField, Vector3};
pub use northing_core::navigation::validity::Validity;

/// Frames that are averaged before the filters start: one second at rest.
pub const REST_FRAMES: u32 = 50;

/// What the IMU said in one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inertial {
    /// Time since the step before, ms; 0 for a frame that stands for none.
    pub dt_ms: u32,
    /// Angular rate, forward, right, down, rad/s.
    pub angular_rate: Vector3<f32>,
    /// Specific force, forward, right, down, m/s^2; `None` when its line was damaged, or when it is no measurement.
    pub specific_force: Option<Vector3<f32>>,
    /// Magnetic field, forward, right, down, microtesla; `None` when its line was damaged.
    pub magnetic_field: Option<Vector3<f32>>,
    /// What the forces before missed, to be made good in this step, m/s.
    pub push: Option<Vector3<f32>>,
    /// What was not measured, or not wholly, for longer than a few samples.
    pub unseen: Unseen,
}

/// Faults that last. What stands for such a sample is a guess.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Unseen {
    /// Of the angular rate.
    pub rate: bool,
    /// Of the specific force.
    pub force: bool,
}

/// A position of the receiver that has not been used yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// Counts the fixes: each is used once.
    pub number: u32,
    /// North, east, down from the first fix, m.
    pub ned: Vector3<f32>,
    /// Velocity north and east, m/s.
    pub velocity: Option<[f32; 2]>,
    /// Horizontal dilution of precision.
    pub hdop: f32,
}

impl Inertial {
    /// Time since the step before, s.
    #[must_use]
    pub fn dt_s(&self) -> f32 {
        self.dt_ms as f32 * 1e-3
    }
}

/// The estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Attitude, once there is one.
    pub attitude: Option<Attitude>,
    /// Position and velocity, once there are.
    pub motion: Option<Motion>,
    /// What the position is worth.
    pub validity: Validity,
}

/// Roll, pitch, yaw of `ned_from_body`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attitude {
    /// rad.
    pub angles: Vector3<f32>,
    /// Standard deviations, rad: of the angles, or of the turn about north, east and down.
    pub std: Vector3<f32>,
}

/// North, east, down from the first fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// m.
    pub position: Vector3<f32>,
    /// m/s.
    pub velocity: Vector3<f32>,
    /// Standard deviations of the position, m.
    pub position_std: Vector3<f32>,
}

/// A build's filters.
pub trait Navigator: Sized {
    /// The name of the build.
    const NAME: &'static [u8];

    /// Filters that start from a mean over a rest; `None` when that is no start.
    fn start(rest: &Inertial) -> Option<Self>;

    /// One step: inertial sensors, and a position where there is a new one.
    fn step(&mut self, inertial: &Inertial, position: Option<&Position>);

    /// What the gyroscope says at rest, rad/s.
    fn gyroscope_bias(&self) -> Vector3<f32>;

    /// The estimate now.
    fn estimate(&self) -> Estimate;

    /// Whether the numbers still are ones; otherwise it has to start again.
    fn is_sound(&self) -> bool;

    /// Gives every number of the state to `take`: equal numbers, equal state.
    fn state_bits(&self, take: impl FnMut(f32));

    /// A hash of the state's bits: equal on two machines when their states are equal to the bit.
    fn fingerprint(&self) -> u32 {
        let mut hash = 0x811c_9dc5_u32;
        // FNV-1a over words; zero has one sign here.
        self.state_bits(|x| hash = (hash ^ (x + 0.0).to_bits()).wrapping_mul(0x0100_0193));
        hash
    }
}

/// The standard deviation of a variance.
fn std_of(variance: f32) -> f32 {
    ComplexField::sqrt(variance.max(0.0))
}

/// Roll, pitch and yaw of a body at rest; a yaw of zero without a field.
fn angles_at_rest(rest: &Inertial) -> Option<[f32; 3]> {
    let (roll, pitch) = tilt_of(&rest.specific_force?, AxisAngles::Exact);
    let roll = roll.unwrap_or(0.0);
    let field = rest.magnetic_field.unwrap_or_default();
    let yaw = tilt_compensated_heading(&field, roll, pitch).unwrap_or(0.0);
    Some([roll, pitch, yaw])
}
