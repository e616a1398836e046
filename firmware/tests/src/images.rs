//! The images: where they are, how much flash and static RAM they take.

use std::path::PathBuf;
use std::{env, fs};

use object::elf::{SHF_ALLOC, SHF_WRITE, SHT_NOBITS};
use object::read::elf::{ElfFile32, FileHeader as _, SectionHeader as _};

/// What an image is built for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Chip {
    /// The paper's: no floating point unit.
    CortexM3,
    /// With a unit for single precision.
    CortexM4F,
}

impl Chip {
    /// Both.
    pub const ALL: [Self; 2] = [Self::CortexM3, Self::CortexM4F];

    /// Its name in `budgets.toml` and in what is printed.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::CortexM3 => "cortex-m3",
            Self::CortexM4F => "cortex-m4f",
        }
    }

    /// QEMU's board with it.
    #[must_use]
    pub const fn machine(self) -> &'static str {
        match self {
            Self::CortexM3 => "mps2-an385",
            Self::CortexM4F => "mps2-an386",
        }
    }

    const fn target(self) -> &'static str {
        match self {
            Self::CortexM3 => "thumbv7m-none-eabi",
            Self::CortexM4F => "thumbv7em-none-eabihf",
        }
    }
}

/// Where an image is.
///
/// # Panics
/// When it is not there: `scripts/build-firmware` builds it.
#[must_use]
pub fn image(chip: Chip, name: &str) -> PathBuf {
    let folder = env::var_os("NORTHING_FIRMWARE_IMAGES")
        .expect("NORTHING_FIRMWARE_IMAGES is not set: run ./scripts/test firmware");
    let path = PathBuf::from(folder)
        .join(chip.target())
        .join("release")
        .join(name);
    assert!(
        path.is_file(),
        "{} is missing: run ./scripts/build-firmware",
        path.display()
    );
    path
}

/// What an image takes, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Code, constants, and the first values of variables.
    pub flash: u32,
    /// Variables.
    pub static_ram: u32,
}

/// Measures an image.
#[must_use]
pub fn size(chip: Chip, name: &str) -> Size {
    let bytes = fs::read(image(chip, name)).unwrap();
    let elf = ElfFile32::<object::Endianness>::parse(&*bytes).unwrap();
    let endian = elf.endian();
    let sections = elf.elf_header().sections(endian, &*bytes).unwrap();
    let mut size = Size {
        flash: 0,
        static_ram: 0,
    };
    for section in sections.iter() {
        let flags = section.sh_flags(endian);
        if (flags & SHF_ALLOC).0 == 0 {
            continue;
        }
        let length = section.sh_size(endian);
        if (flags & SHF_WRITE).0 != 0 {
            size.static_ram += length;
        }
        if section.sh_type(endian) != SHT_NOBITS {
            size.flash += length;
        }
    }
    size
}
