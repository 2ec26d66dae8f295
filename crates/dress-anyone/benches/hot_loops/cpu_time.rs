//! Processor time as what criterion measures: unlike the clock on the wall it does not count what
//! other jobs on the same cores take.

use criterion::Throughput;
use criterion::measurement::{Measurement, ValueFormatter, WallTime};

/// Time that all threads of this process were running \[ns\]; where the system does not tell, time that
/// went by.
pub(crate) struct CpuTime {
    #[cfg(not(unix))]
    since: std::time::Instant,
}

impl CpuTime {
    pub(crate) fn new() -> Self {
        Self {
            #[cfg(not(unix))]
            since: std::time::Instant::now(),
        }
    }

    #[cfg(unix)]
    #[expect(clippy::unused_self, reason = "elsewhere it has to remember its start")]
    fn now(&self) -> f64 {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
        time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
    }

    #[cfg(not(unix))]
    fn now(&self) -> f64 {
        self.since.elapsed().as_secs_f64() * 1e9
    }
}

impl Measurement for CpuTime {
    type Intermediate = f64;
    type Value = f64;

    fn start(&self) -> f64 {
        self.now()
    }

    fn end(&self, start: f64) -> f64 {
        self.now() - start
    }

    fn add(&self, a: &f64, b: &f64) -> f64 {
        a + b
    }

    fn zero(&self) -> f64 {
        0.0
    }

    fn to_f64(&self, value: &f64) -> f64 {
        *value
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        &Nanoseconds
    }
}

/// Nanoseconds, shown as criterion shows those of the clock on the wall.
struct Nanoseconds;

impl ValueFormatter for Nanoseconds {
    fn scale_values(&self, typical: f64, values: &mut [f64]) -> &'static str {
        WallTime.formatter().scale_values(typical, values)
    }

    fn scale_throughputs(
        &self,
        typical: f64,
        throughput: &Throughput,
        values: &mut [f64],
    ) -> &'static str {
        (WallTime.formatter()).scale_throughputs(typical, throughput, values)
    }

    fn scale_for_machines(&self, values: &mut [f64]) -> &'static str {
        WallTime.formatter().scale_for_machines(values)
    }
}
