//! The application on the host: what the emulated board does with a tick, without the board.

use northing_firmware::application::Overruns;
use northing_firmware::ring::Ring;
use northing_firmware::{Application, Navigator, ResetCause};

use crate::{Board, Tick};

/// The same application, in the host's own arithmetic.
#[derive(Debug)]
pub struct Host<N> {
    application: Application<N>,
    imu: Ring<256>,
    gnss: Ring<512>,
    now_us: u32,
    /// What it said at its start.
    waiting: Vec<u8>,
}

impl<N: Navigator> Host<N> {
    /// A board that has just started, for this cause, 30 seconds before its counter rolls over.
    #[must_use]
    pub fn start(cause: ResetCause) -> Self {
        let now_us = 0_u32.wrapping_sub(30_000_000);
        let mut waiting = Vec::new();
        let application = Application::new(cause, now_us, &mut |byte| waiting.push(byte));
        Self {
            application,
            imu: Ring::new(),
            gnss: Ring::new(),
            now_us,
            waiting,
        }
    }
}

impl<N: Navigator> Board for Host<N> {
    fn tick(&mut self, tick: &Tick) -> Vec<u8> {
        for byte in &tick.imu {
            self.imu.push(*byte);
        }
        for byte in &tick.gnss {
            self.gnss.push(*byte);
        }
        let mut output = std::mem::take(&mut self.waiting);
        let mut out = |byte| output.push(byte);
        self.now_us = self.now_us.wrapping_add(u32::from(tick.ms) * 1000);
        let now_us = self.now_us;
        while let Some(byte) = self.gnss.pop() {
            self.application.gnss_byte(byte, now_us);
        }
        while let Some(byte) = self.imu.pop() {
            self.application.imu_byte(byte, now_us, &mut out);
        }
        let overruns = Overruns {
            imu: self.imu.lost(),
            gnss: self.gnss.lost(),
        };
        self.application.poll(now_us, overruns, &mut out);
        output
    }
}
