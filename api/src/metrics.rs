//! Counters of the service in the text format of Prometheus.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use crate::jobs::record::JobState;

/// Upper ends of the histograms' buckets in seconds: an answer from memory up to the longest job.
const BUCKETS: [f64; 12] = [0.005, 0.02, 0.1, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 100.0, 300.0, 3600.0];

#[derive(Debug, Default, Clone)]
struct Histogram {
    buckets: [u64; BUCKETS.len()],
    sum: f64,
    count: u64,
}

impl Histogram {
    fn observe(&mut self, time: Duration) {
        let seconds = time.as_secs_f64();
        for (bucket, end) in self.buckets.iter_mut().zip(BUCKETS) {
            *bucket += u64::from(seconds <= end);
        }
        self.sum += seconds;
        self.count += 1;
    }

    fn write(&self, text: &mut String, name: &str, labels: &str) {
        for (bucket, end) in self.buckets.iter().zip(BUCKETS) {
            let _ = writeln!(text, "{name}_bucket{{{labels},le=\"{end}\"}} {bucket}");
        }
        let _ = writeln!(text, "{name}_bucket{{{labels},le=\"+Inf\"}} {}", self.count);
        let _ = writeln!(text, "{name}_sum{{{labels}}} {}", self.sum);
        let _ = writeln!(text, "{name}_count{{{labels}}} {}", self.count);
    }
}

/// What is counted. Labels are routes, methods, statuses, kinds, phases and states: a bounded set.
#[derive(Debug, Default)]
pub struct Metrics {
    requests: Mutex<BTreeMap<(String, String, u16), u64>>,
    latency: Mutex<BTreeMap<String, Histogram>>,
    jobs: Mutex<BTreeMap<(String, &'static str), Histogram>>,
    phases: Mutex<BTreeMap<(String, String), Histogram>>,
    cancelled: Mutex<Histogram>,
    accepted: AtomicU64,
    reused: AtomicU64,
    triangles: AtomicU64,
    bytes: AtomicU64,
}

impl Metrics {
    /// Counts an answered request.
    pub fn request(&self, method: &str, route: &str, status: u16, time: Duration) {
        *crate::locked(&self.requests).entry((method.to_owned(), route.to_owned(), status)).or_default() += 1;
        crate::locked(&self.latency).entry(route.to_owned()).or_default().observe(time);
    }

    /// Counts an accepted job.
    pub fn accepted(&self) {
        self.accepted.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts a job that was answered from finished work.
    pub fn reused(&self) {
        self.reused.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts a job that a worker has ended.
    pub fn ended(&self, kind: &str, state: JobState, time: Duration) {
        crate::locked(&self.jobs).entry((kind.to_owned(), state.word())).or_default().observe(time);
    }

    /// Counts a phase of a job, from its first step to that of the next one or to the end.
    pub fn phase(&self, kind: &str, phase: &str, time: Duration) {
        crate::locked(&self.phases).entry((kind.to_owned(), phase.to_owned())).or_default().observe(time);
    }

    /// Counts the time from a wish to stop, as the worker heard of it, to the record of the stop.
    pub fn stopped_after(&self, time: Duration) {
        crate::locked(&self.cancelled).observe(time);
    }

    /// Counts what a job made.
    pub fn made(&self, triangles: u64, bytes: u64) {
        self.triangles.fetch_add(triangles, Ordering::Relaxed);
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
    }

    /// Everything as text; the gauges are the caller's: name, help, value.
    #[must_use]
    pub fn render(&self, gauges: &[(&str, &str, u64)]) -> String {
        let mut text = String::new();
        heading(&mut text, "lacuna_http_requests_total", "counter", "answered requests");
        for ((method, route, status), count) in crate::locked(&self.requests).iter() {
            let _ = writeln!(text, "lacuna_http_requests_total{{method=\"{method}\",route=\"{route}\",status=\"{status}\"}} {count}");
        }
        heading(&mut text, "lacuna_http_request_seconds", "histogram", "time to the first byte of an answer");
        for (route, histogram) in crate::locked(&self.latency).iter() {
            histogram.write(&mut text, "lacuna_http_request_seconds", &format!("route=\"{route}\""));
        }
        heading(&mut text, "lacuna_job_seconds", "histogram", "time a worker spent on a job");
        for ((kind, state), histogram) in crate::locked(&self.jobs).iter() {
            histogram.write(&mut text, "lacuna_job_seconds", &format!("kind=\"{kind}\",state=\"{state}\""));
        }
        heading(&mut text, "lacuna_phase_seconds", "histogram", "time that a phase of a job took");
        for ((kind, phase), histogram) in crate::locked(&self.phases).iter() {
            histogram.write(&mut text, "lacuna_phase_seconds", &format!("kind=\"{kind}\",phase=\"{phase}\""));
        }
        heading(&mut text, "lacuna_cancel_seconds", "histogram", "time from a wish to stop a job to its stop");
        crate::locked(&self.cancelled).write(&mut text, "lacuna_cancel_seconds", "reason=\"caller\"");
        let counters = [
            ("lacuna_jobs_accepted_total", "accepted jobs", &self.accepted),
            ("lacuna_jobs_reused_total", "jobs answered from finished work", &self.reused),
            ("lacuna_triangles_total", "triangles made", &self.triangles),
            ("lacuna_output_bytes_total", "bytes of result files", &self.bytes),
        ];
        for (name, help, value) in counters {
            heading(&mut text, name, "counter", help);
            let _ = writeln!(text, "{name} {}", value.load(Ordering::Relaxed));
        }
        for (name, help, value) in gauges {
            heading(&mut text, name, "gauge", help);
            let _ = writeln!(text, "{name} {value}");
        }
        text
    }
}

fn heading(text: &mut String, name: &str, kind: &str, help: &str) {
    let _ = writeln!(text, "# HELP {name} {help}\n# TYPE {name} {kind}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_are_cumulative() {
        let metrics = Metrics::default();
        metrics.request("GET", "/livez", 200, Duration::from_millis(1));
        metrics.request("GET", "/livez", 200, Duration::from_secs(2));
        let text = metrics.render(&[("lacuna_jobs_queued", "jobs that wait", 3)]);
        assert!(text.contains("lacuna_http_requests_total{method=\"GET\",route=\"/livez\",status=\"200\"} 2"));
        assert!(text.contains("lacuna_http_request_seconds_bucket{route=\"/livez\",le=\"0.005\"} 1"));
        assert!(text.contains("lacuna_http_request_seconds_bucket{route=\"/livez\",le=\"2.5\"} 2"));
        assert!(text.contains("lacuna_http_request_seconds_bucket{route=\"/livez\",le=\"+Inf\"} 2"));
        assert!(text.ends_with("lacuna_jobs_queued 3\n"));
    }
}
