//! The studies of a plan, one after the other.

use std::cell::RefCell;

use anyhow::Result;
use dapple_render::image::Rgb8Image;
use serde_json::json;

use super::{Run, paths, slug};
use crate::eval::pair::Starts;
use crate::eval::plan::StudyEntry;
use crate::eval::results::{Machine, StudyPicture, StudyResult};
use crate::eval::stage::Stage;
use crate::eval::study::Subject;
use crate::picture::write_png;
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
        let files = |found: &StudyResult| found.pictures.iter().map(|shot| shot.file.clone()).collect();
        if let Some(found) = self.journal.get(&key, files) {
            self.reused += 1;
            self.work.finish(&what, work, false);
            return Ok(found);
        }
        self.work.begin(&what);
        let bar = &self.work;
        let progress = |part: f64| bar.part(work, part);
        let shots = RefCell::default();
        let looks = Subject { stage, cache: &self.cache, progress: &progress, shots: &shots };
        let found = study.study.run(&looks)?;
        let folder = slug(subject.as_deref().map_or(&*study.kind, |subject| subject));
        let mut pictures = Vec::new();
        for (number, shot) in shots.into_inner().into_iter().enumerate() {
            let file = format!("pictures/{folder}/{}.{}/{number:02}.png", study.kind, key.short());
            let Rgb8Image { width, height, pixels } = &shot.picture;
            write_png(&self.out.join(&file), *width, *height, pixels)?;
            pictures.push(StudyPicture { title: shot.title, file });
        }
        let found = StudyResult {
            kind: study.kind.clone(),
            title: study.study.title().to_owned(),
            subject,
            notes: found.notes,
            tables: found.tables,
            plots: found.plots,
            pictures,
            machine: Machine::here(),
        };
        self.journal.put(&key, &found)?;
        self.work.finish(&what, work, true);
        Ok(found)
    }
}
