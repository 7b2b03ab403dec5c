//! The studies of a plan, one after the other.

use anyhow::Result;
use serde_json::json;

use super::{Run, paths};
use crate::eval::pair::Starts;
use crate::eval::plan::StudyEntry;
use crate::eval::results::{Machine, StudyResult};
use crate::eval::stage::Stage;
use crate::eval::study::Subject;
use crate::source;

impl Run<'_> {
    /// One study; `more` are to come.
    pub(super) fn study(&mut self, study: &StudyEntry, more: usize) -> Result<StudyResult> {
        let Some(entry) = &study.entry else {
            self.open_folder()?;
            return self.measure(study, None, None, more);
        };
        self.work.message(&format!("loading {}", entry.name));
        let loaded = source::load(&entry.scene, None)?;
        self.open_folder()?;
        let radius = source::radius_of(&loaded.scene, entry.settings.radius)?;
        let path = paths(&loaded, &entry.settings.paths)?.swap_remove(0);
        let starts = Starts::new(&loaded.scene);
        let stage = Stage::new(&loaded, &entry.settings, path, radius, starts.tracer().clone());
        let name = format!("{} / {}", entry.name, stage.path.name);
        self.measure(study, Some(&stage), Some(name), more)
    }

    fn measure(
        &mut self,
        study: &StudyEntry,
        stage: Option<&Stage<'_>>,
        subject: Option<String>,
        more: usize,
    ) -> Result<StudyResult> {
        let what = match &subject {
            Some(subject) => format!("study {}: {subject}", study.kind),
            None => format!("study {}", study.kind),
        };
        let work = study.study.work(stage);
        self.work.expect(1, work, more);
        let key = self.journal.key(json!({
            "study": format!("{:?}", study.study),
            "kind": study.kind,
            "stage": stage.map(|stage| self.identity(stage)),
            "settings": stage.map(|stage| format!("{:?} {:?}", stage.settings.methods, stage.settings.effort)),
        }));
        if let Some(found) = self.journal.get(&key, |_: &StudyResult| Vec::new()) {
            self.reused += 1;
            self.work.finish(&what, work, false);
            return Ok(found);
        }
        self.work.begin(&what);
        let bar = &self.work;
        let progress = |part: f64| bar.part(work, part);
        let found = study.study.run(&Subject { stage, cache: &self.cache, progress: &progress })?;
        let found = StudyResult {
            kind: study.kind.clone(),
            title: study.study.title().to_owned(),
            subject,
            notes: found.notes,
            tables: found.tables,
            plots: found.plots,
            machine: Machine::here(),
        };
        self.journal.put(&key, &found)?;
        self.work.finish(&what, work, true);
        Ok(found)
    }
}
