//! Writes a trajectory in TUM form: `timestamp tx ty tz qx qy qz qw`, one pose a line.
//!
//! This is the one file of ours with the quaternion's scalar last, because the form demands it. The form has no place for the world
//! frame, and its readers pass over lines that begin with `#`: there it is said, for a reader that has to know which way z points.

use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};

use crate::atomic_file::AtomicFile;
use crate::error::Result;
use crate::metadata::WorldFrame;
use crate::stamp;
use crate::writer::quaternion_to_file;

/// A TUM trajectory being written.
#[derive(Debug)]
pub struct TumWriter {
    output: AtomicFile,
    world: WorldFrame,
    is_begun: bool,
}

impl TumWriter {
    /// Starts the file of poses in this world frame.
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn create(path: &Path, world: WorldFrame, force: bool) -> Result<Self> {
        Ok(Self {
            output: AtomicFile::create(path, force)?,
            world,
            is_begun: false,
        })
    }

    /// Says what the world frame is, before the first pose.
    pub fn set_world(&mut self, world: WorldFrame) {
        self.world = world;
    }

    fn begin(&mut self) -> Result<()> {
        if !std::mem::replace(&mut self.is_begun, true) {
            let world = self.world.name();
            self.output.print(format_args!(
                "# timestamp tx ty tz qx qy qz qw\n# world_frame: {world}\n"
            ))?;
        }
        Ok(())
    }

    /// Writes one pose: stamp, position in the world frame (m; zeros for attitude only) and
    /// attitude, body to world.
    ///
    /// # Errors
    /// [`crate::RecordingError::Io`].
    pub fn write(
        &mut self,
        time_ns: i64,
        position_m: &Vector3<f64>,
        world_from_body: &UnitQuaternion<f64>,
    ) -> Result<()> {
        self.begin()?;
        let [w, x, y, z] = quaternion_to_file(world_from_body);
        let [px, py, pz] = [position_m.x, position_m.y, position_m.z];
        let t = stamp::format_s(time_ns);
        self.output
            .print(format_args!("{t} {px} {py} {pz} {x} {y} {z} {w}\n"))
    }

    /// Completes the file.
    ///
    /// # Errors
    /// As [`AtomicFile::commit`].
    pub fn finish(mut self) -> Result<()> {
        self.begin()?;
        self.output.commit()
    }
}

#[cfg(test)]
mod tests {
    use super::TumWriter;
    use crate::metadata::WorldFrame;
    use nalgebra::{UnitQuaternion, Vector3};

    #[test]
    fn lines_have_the_scalar_last_and_not_negative() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.tum");
        let mut writer = TumWriter::create(&path, WorldFrame::Enu, false).unwrap();
        let half_turn =
            UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(-0.0, 0.0, 0.0, 1.0));
        let negative =
            UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(-0.6, 0.0, 0.8, 0.0));
        writer
            .write(0, &Vector3::zeros(), &UnitQuaternion::identity())
            .unwrap();
        writer
            .write(1_500_000_001, &Vector3::new(1.0, -2.5, 3.0), &negative)
            .unwrap();
        writer
            .write(2_000_000_000, &Vector3::zeros(), &half_turn)
            .unwrap();
        writer.finish().unwrap();
        assert_eq!(
            std::fs::read_to_string(&path).unwrap(),
            "# timestamp tx ty tz qx qy qz qw\n\
             # world_frame: enu\n\
             0.0 0 0 0 0 0 0 1\n\
             1.500000001 1 -2.5 3 -0 -0.8 -0 0.6\n\
             2.0 0 0 0 0 0 1 -0\n"
        );
    }
}
