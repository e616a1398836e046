//! What a run tells beside its estimates: the summary with its verdicts, and the trace of the plots. Of arrays it is made when it is
//! first asked for, by running over them once more: most callers want the estimates only.

use std::sync::OnceLock;

use northing_evaluation::attitude::{RunObserver, RunOptions, RunSummary, Trace, TraceObserver};
use northing_evaluation::{EvaluationError, run_recording};
use northing_recording::{Metadata, Recording, WorldFrame};
use northing_report::TRACE_CAPACITY;
use pyo3::prelude::*;

use crate::attitude_run::Collector;
use crate::errors::of_run;
use crate::samples::{Arrays, NAME};

/// Summary, metadata and trace of a run.
pub(crate) struct Told {
    pub(crate) summary: RunSummary,
    pub(crate) metadata: Metadata,
    pub(crate) trace: Trace,
}

impl Told {
    /// By a run over a recording, which the observer watches; `name` stands for it in the summary.
    ///
    /// # Errors
    /// Those of the run.
    pub(crate) fn of<O: RunObserver>(
        recording: &mut Recording,
        name: &str,
        options: &RunOptions,
        observer: O,
    ) -> Result<(Self, O), EvaluationError> {
        let metadata = recording.metadata().clone();
        let mut watchers = (
            observer,
            TraceObserver::new(TRACE_CAPACITY, metadata.world_frame),
        );
        let mut summary = run_recording(recording, options, &mut watchers)?;
        name.clone_into(&mut summary.recording);
        let (observer, trace) = watchers;
        let told = Self {
            summary,
            metadata,
            trace: trace.into_trace(),
        };
        Ok((told, observer))
    }
}

/// What is told already, or what tells it.
pub(crate) enum Telling {
    /// By the run itself.
    Told(Box<Told>),
    /// When it is asked for.
    Asked(Box<Asked>),
}

/// Arrays, how they were run over, and what that told.
pub(crate) struct Asked {
    arrays: Arrays,
    options: RunOptions,
    told: OnceLock<Told>,
}

impl Telling {
    /// Of a run over arrays with these options.
    pub(crate) fn of_arrays(arrays: Arrays, options: RunOptions) -> Self {
        Self::Asked(Box::new(Asked {
            arrays,
            options,
            told: OnceLock::new(),
        }))
    }

    /// The world of what was run over.
    pub(crate) fn world(&self) -> WorldFrame {
        match self {
            Self::Told(told) => told.metadata.world_frame,
            Self::Asked(asked) => asked.arrays.world_frame(),
        }
    }

    /// The same run once more, for everything that it gives.
    ///
    /// # Errors
    /// Those of a run over arrays, as `ValueError`.
    pub(crate) fn again(&self, py: Python<'_>) -> PyResult<Collector> {
        let Self::Asked(asked) = self else {
            return Ok(Collector::of_recording());
        };
        let mut collected = Collector::of_arrays(asked.arrays.stamps(), true);
        let run = py.detach(|| asked.arrays.estimate(&asked.options, &mut collected));
        run.map_err(|error| of_run(&error, NAME))?;
        Ok(collected)
    }

    /// What the run tells.
    ///
    /// # Errors
    /// Those of a run over arrays, as `ValueError`.
    pub(crate) fn told(&self, py: Python<'_>) -> PyResult<&Told> {
        let asked = match self {
            Self::Told(told) => return Ok(told),
            Self::Asked(asked) => asked,
        };
        if let Some(told) = asked.told.get() {
            return Ok(told);
        }
        let told = py.detach(|| {
            let mut recording = asked.arrays.recording();
            Told::of(&mut recording, NAME, &asked.options, ())
        });
        let (told, ()) = told.map_err(|error| of_run(&error, NAME))?;
        // Of two threads that ask at once the first counts; both say the same.
        Ok(asked.told.get_or_init(|| told))
    }
}
