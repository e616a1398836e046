//! InvenSense MPU-9250 (and MPU-6500) over SPI: angular rate and specific force, 50 Hz.
//!
//! Read first: the register map, RM-MPU-9250A-00. Any bus that is an `embedded_hal` SPI device will do.

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{Operation, SpiDevice};
use northing_firmware::application::Frame;

const SAMPLE_RATE_DIVIDER: u8 = 0x19;
const CONFIGURATION: u8 = 0x1a;
const GYROSCOPE_CONFIGURATION: u8 = 0x1b;
const ACCELEROMETER_CONFIGURATION: u8 = 0x1c;
const STATUS: u8 = 0x3a;
/// Force, temperature, rate: seven times two bytes, the higher first.
const MEASUREMENTS: u8 = 0x3b;
const USER_CONTROL: u8 = 0x6a;
const POWER: u8 = 0x6b;
const WHO_AM_I: u8 = 0x75;
/// In the address: a read.
const READ: u8 = 0x80;

/// Of an MPU-9250 and an MPU-6500.
const KNOWN: [u8; 2] = [0x71, 0x70];

/// What went wrong.
#[derive(Debug)]
pub(crate) enum Error<E> {
    /// The bus.
    Bus(E),
    /// Another part answers, or none.
    Unknown,
}

impl<E> From<E> for Error<E> {
    fn from(error: E) -> Self {
        Self::Bus(error)
    }
}

/// The sensor.
#[derive(Debug)]
pub(crate) struct Mpu9250<S> {
    spi: S,
}

impl<S: SpiDevice> Mpu9250<S> {
    /// Resets it and sets 50 Hz, 500 deg/s, 4 g, and a low-pass of 20 Hz.
    pub(crate) fn start(spi: S, pause: &mut impl DelayNs) -> Result<Self, Error<S::Error>> {
        let mut sensor = Self { spi };
        sensor.set(POWER, 0x80)?;
        pause.delay_ms(100);
        if !KNOWN.contains(&sensor.get(WHO_AM_I)?) {
            return Err(Error::Unknown);
        }
        for (register, value) in [
            (POWER, 0x01),
            (USER_CONTROL, 0x10),
            (CONFIGURATION, 4),
            (SAMPLE_RATE_DIVIDER, 19),
            (GYROSCOPE_CONFIGURATION, 0x08),
            (ACCELEROMETER_CONFIGURATION, 0x08),
        ] {
            sensor.set(register, value)?;
        }
        Ok(sensor)
    }

    /// The next frame, when there is a new one.
    pub(crate) fn frame(&mut self) -> Result<Option<Frame>, S::Error> {
        if self.get(STATUS)? & 1 == 0 {
            return Ok(None);
        }
        let mut bytes = [0; 14];
        self.spi.transaction(&mut [
            Operation::Write(&[MEASUREMENTS | READ]),
            Operation::Read(&mut bytes),
        ])?;
        Ok(Some(frame(&bytes)))
    }

    fn get(&mut self, register: u8) -> Result<u8, S::Error> {
        let mut value = [0];
        self.spi.transaction(&mut [
            Operation::Write(&[register | READ]),
            Operation::Read(&mut value),
        ])?;
        let [value] = value;
        Ok(value)
    }

    fn set(&mut self, register: u8, value: u8) -> Result<(), S::Error> {
        self.spi.write(&[register, value])
    }
}

/// From the sensor's axes (forward, left, up) and counts to ours.
fn frame(bytes: &[u8; 14]) -> Frame {
    let [ax, ay, az, _, gx, gy, gz] = counts(bytes);
    // 8192 counts are 98066.5 units of force; 65.5 counts are 1 deg/s, 1745.33 units of rate.
    let force = |count: i32| count * 12_258 / 1024;
    let rate = |count: i32| count * 27_286 / 1024;
    Frame {
        force: Some([force(ax), force(-ay), force(-az)]),
        field: None,
        rate: [rate(gx), rate(-gy), rate(-gz)],
    }
}

fn counts(bytes: &[u8; 14]) -> [i32; 7] {
    let mut counts = [0; 7];
    for (count, pair) in counts.iter_mut().zip(bytes.as_chunks::<2>().0) {
        *count = i32::from(i16::from_be_bytes(*pair));
    }
    counts
}
