//! What lies over the picture: figures, choices, time, help, messages.

use dapple_client::viewer::{DebugView, Method};
use egui::{Align2, Color32, Context, RichText, Slider, Ui, vec2};

use super::quality::{PRESETS, Quality};
use super::show::{Figures, Show};
use crate::args::Preset;
use crate::live::LinkState;
use dapple_session::Role;

/// Width of the panel, in the overlay's units.
const PANEL_WIDTH: f32 = 240.0;

/// Every key and what it does.
pub(super) const KEYS: [(&str, &str); 18] = [
    ("drag", "turn; on foot: look around"),
    ("right drag, Shift drag", "move sideways"),
    ("wheel", "come closer, go back"),
    ("W A S D, Q E", "walk, sink and rise"),
    ("O", "orbit or on foot"),
    ("C", "next camera of the scene"),
    ("F", "all of the scene"),
    ("R", "record a camera path; stop and write it"),
    ("Space", "pause, go on"),
    ("Left, Right, Home", "one update back or ahead, the beginning"),
    ("M", "next method"),
    ("L", "area lights on and off"),
    ("B", "split screen; drag the line"),
    ("V, 1 to 8", "next view; that view"),
    ("F12, P", "screenshot without this overlay"),
    ("F11", "full screen"),
    ("U", "overlay on or off"),
    ("H, F1", "this help"),
];

/// Seconds that a message stays.
const NOTICE_S: f64 = 6.0;

/// The state of the overlay.
#[derive(Default)]
pub(super) struct Overlay {
    pub(super) hidden: bool,
    pub(super) help: bool,
    notice: Option<(String, f64)>,
    /// An error that stays.
    pub(super) failure: Option<String>,
    /// Seconds of the camera path that is being recorded.
    pub(super) recorded_s: Option<f64>,
}

/// What the overlay asks for that it cannot do itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Wish {
    Preset(Preset),
    Screenshot,
}

impl Overlay {
    /// Shows a message for a while.
    pub(super) fn tell(&mut self, text: String, now_s: f64) {
        self.notice = Some((text, now_s + NOTICE_S));
    }

    /// Seconds after which it would look different by itself.
    pub(super) fn stale_after_s(&self) -> f64 {
        0.25
    }

    /// Lays everything out.
    pub(super) fn lay(&mut self, ui: &mut Ui, show: &mut Show, now_s: f64) -> Option<Wish> {
        let ctx = ui.ctx().clone();
        let mut wish = None;
        if !self.hidden {
            time_bar(ui, show);
            let figures = show.figures(now_s);
            let room = (ctx.content_rect().height() - 60.0).max(60.0);
            egui::Window::new("dapple").anchor(Align2::LEFT_TOP, vec2(8.0, 8.0)).resizable(false).show(
                &ctx,
                |ui| {
                    // The window's own scrolling would keep the height of a smaller window.
                    ui.set_max_width(PANEL_WIDTH);
                    egui::ScrollArea::vertical().max_height(room).show(ui, |ui| {
                        figures_grid(ui, show, &figures);
                        ui.separator();
                        wish = choices(ui, show);
                        ui.horizontal(|ui| {
                            if ui.button("Screenshot").clicked() {
                                wish = Some(Wish::Screenshot);
                            }
                            if ui.button("Help (H)").clicked() {
                                self.help = !self.help;
                            }
                        });
                    });
                },
            );
        }
        divider(&ctx, show);
        self.messages(&ctx, show, now_s);
        if self.help {
            help(&ctx, &mut self.help);
        }
        wish
    }

    fn messages(&mut self, ctx: &Context, show: &mut Show, now_s: f64) {
        if self.notice.as_ref().is_some_and(|(_, until_s)| now_s > *until_s) {
            self.notice = None;
        }
        let preparing = show.feed.preparing();
        // What stays as it is until something else is shown.
        let broken = match show.feed.remote().map(|remote| remote.state()) {
            Some(LinkState::Waiting(reason, seconds)) => {
                Some(format!("{reason}; trying again in {seconds:.1} s"))
            }
            Some(LinkState::Ended(reason)) => Some(reason),
            _ => None,
        };
        let lasting = [self.failure.as_deref(), show.problem(), broken.as_deref()];
        let recording =
            self.recorded_s.map(|seconds| format!("recording the camera: {seconds:.1} s; R stops"));
        if self.notice.is_none() && preparing.is_none() && recording.is_none() && lasting == [None; 3] {
            return;
        }
        egui::Area::new(egui::Id::unique("messages"))
            .anchor(Align2::CENTER_TOP, vec2(0.0, 8.0))
            .interactable(false)
            .show(ctx, |ui| {
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    if let Some((what, part)) = preparing {
                        let bar = egui::ProgressBar::new(part).desired_width(240.0);
                        ui.add(bar.text(format!("{what} {:.0} %", 100.0 * part)));
                    }
                    for text in lasting.into_iter().flatten() {
                        ui.label(RichText::new(text).color(Color32::LIGHT_RED));
                    }
                    if let Some(text) = recording {
                        ui.label(RichText::new(text).color(Color32::LIGHT_RED));
                    }
                    if let Some((text, _)) = &self.notice {
                        ui.label(text);
                    }
                });
            });
    }
}

fn figures_grid(ui: &mut Ui, show: &mut Show, figures: &Figures) {
    let viewer = &figures.viewer;
    let age = figures.age_s.map_or("–".to_owned(), |age_s| format!("{age_s:.1} s"));
    let texels = match figures.progress {
        progress if !progress.is_complete() => {
            format!("{:.0} %", 100.0 * progress.done as f64 / progress.total as f64)
        }
        _ => viewer.texels.to_string(),
    };
    let (heap, card) = viewer.memory_bytes;
    let rows = [
        ("pictures", format!("{:.1} /s", figures.fps)),
        ("stream", format!("{:.2} Mbit/s", figures.megabits_per_second)),
        ("received", size(viewer.bytes_received)),
        ("points", viewer.points.to_string()),
        ("changed", format!("{:.0} /s", figures.changed_per_second)),
        ("age of light", age),
        ("texels", texels),
        ("memory", format!("{} + {}", size(heap), size(card))),
        ("light", show.feed.label()),
        ("camera", show.steering.label().to_owned()),
    ];
    let rows = rows.into_iter().chain(live_rows(show));
    egui::Grid::new("figures").num_columns(2).spacing([12.0, 2.0]).show(ui, |ui| {
        for (name, value) in rows {
            ui.weak(name);
            ui.monospace(value);
            ui.end_row();
        }
    });
}

/// What there is to say of a live session: where the time goes from the host's step to here.
fn live_rows(show: &mut Show) -> Vec<(&'static str, String)> {
    let Some(remote) = show.feed.remote() else { return Vec::new() };
    let figures = remote.figures();
    let ms = |seconds: f64| format!("{:.1} ms", 1e3 * seconds);
    let latency = figures.latency;
    let role = match figures.role {
        Some(Role::Interact) => "may change things",
        Some(Role::View) => "looks",
        None => "–",
    };
    vec![
        ("viewers", format!("{}, this one {role}", figures.status.viewers)),
        ("visibility is", figures.age_s.map_or("–".to_owned(), |age_s| format!("{} old", ms(age_s)))),
        ("  step", ms(latency.step_s)),
        ("  queue", ms(latency.queue_s)),
        ("  network", ms(latency.network_s)),
        ("  apply", ms(latency.apply_s)),
    ]
}

fn choices(ui: &mut Ui, show: &mut Show) -> Option<Wish> {
    let mut wish = None;
    let pick_method = |ui: &mut Ui, label: &str, method: &mut Method| {
        egui::ComboBox::from_label(label).selected_text(method.name()).show_ui(ui, |ui| {
            for choice in Method::ALL {
                ui.selectable_value(method, choice, choice.name());
            }
        });
    };
    pick_method(ui, "method", &mut show.options.method);
    let mut split = show.options.split.is_some();
    ui.checkbox(&mut split, "split screen (B)");
    if !split {
        show.options.split = None;
    } else if show.options.split.is_none() {
        show.options.split = Some((0.5, Method::None));
    }
    if let Some((_, other)) = &mut show.options.split {
        pick_method(ui, "right of the line", other);
    }
    egui::ComboBox::from_label("view").selected_text(show.options.view.name()).show_ui(ui, |ui| {
        for choice in DebugView::ALL {
            ui.selectable_value(&mut show.options.view, choice, choice.name());
        }
    });
    let quality = show.quality();
    let preset = PRESETS.iter().find(|(preset, _)| Quality::of(*preset) == quality);
    let text = preset.map_or("as given", |(_, name)| name);
    egui::ComboBox::from_label("preset").selected_text(text).show_ui(ui, |ui| {
        for (choice, name) in PRESETS {
            if ui.selectable_label(preset.is_some_and(|(p, _)| *p == choice), name).clicked() {
                wish = Some(Wish::Preset(choice));
            }
        }
    });
    let names: Vec<String> = show.steering.paths().map(str::to_owned).collect();
    let label = show.steering.label().to_owned();
    egui::ComboBox::from_label("camera").selected_text(&label).show_ui(ui, |ui| {
        for (index, name) in names.iter().enumerate() {
            if ui.selectable_label(*name == label, name).clicked() {
                show.steering.follow(index);
            }
        }
    });
    wish
}

/// Pause and the time slider, along the lower edge.
fn time_bar(ui: &mut Ui, show: &mut Show) {
    egui::Panel::bottom("time").show(ui, |ui| {
        ui.horizontal(|ui| {
            let playing = show.clock.is_playing();
            if ui.button(if playing { "Pause" } else { "Play" }).clicked() {
                show.set_playing(!playing);
            }
            let duration_s = show.clock.duration_s().max(0.001);
            let mut time_s = show.clock.time_s();
            ui.spacing_mut().slider_width = (ui.available_width() - 90.0).max(60.0);
            let slider = Slider::new(&mut time_s, 0.0..=duration_s).suffix(" s").fixed_decimals(2);
            if ui.add(slider).changed() {
                show.seek(time_s);
            }
        });
    });
}

/// The line between two methods, which can be dragged.
fn divider(ctx: &Context, show: &mut Show) {
    /// Width of the handle, points.
    const HANDLE: f32 = 12.0;
    /// Height of the time bar below it, points.
    const BELOW: f32 = 36.0;
    let (method, view) = (show.options.method, show.options.view);
    let Some((part, other)) = &mut show.options.split else { return };
    let mut screen = ctx.content_rect();
    screen.max.y = (screen.max.y - BELOW).max(screen.min.y);
    let x = screen.left() + *part * screen.width();
    let area = egui::Area::new(egui::Id::unique("divider"))
        .fixed_pos(egui::pos2(x - 0.5 * HANDLE, screen.top()))
        .constrain(false);
    area.show(ctx, |ui| {
        let (rect, response) = ui.allocate_exact_size(vec2(HANDLE, screen.height()), egui::Sense::drag());
        let active = response.hovered() || response.dragged();
        let stroke = egui::Stroke::new(if active { 3.0 } else { 1.0 }, Color32::WHITE);
        ui.painter().vline(rect.center().x, rect.y_range(), stroke);
        if active {
            ctx.set_cursor_icon(egui::CursorIcon::ResizeHorizontal);
        }
        *part = ((x + response.drag_delta().x - screen.left()) / screen.width()).clamp(0.0, 1.0);
        let painter = ctx.layer_painter(egui::LayerId::background());
        let label = |align: Align2, side: f32, text: &str| {
            let at = egui::pos2(rect.center().x + side, screen.bottom() - 8.0);
            painter.text(at, align, text, egui::FontId::proportional(14.0), Color32::WHITE);
        };
        label(Align2::RIGHT_BOTTOM, -8.0, method.name());
        let right = if view == DebugView::Error { view.name() } else { other.name() };
        label(Align2::LEFT_BOTTOM, 8.0, right);
    });
}

fn help(ctx: &Context, open: &mut bool) {
    egui::Window::new("Keys")
        .open(open)
        .collapsible(false)
        .resizable(false)
        .anchor(Align2::CENTER_CENTER, vec2(0.0, 0.0))
        .show(ctx, |ui| {
            egui::Grid::new("keys").num_columns(2).spacing([16.0, 4.0]).show(ui, |ui| {
                for (key, does) in KEYS {
                    ui.strong(key);
                    ui.label(does);
                    ui.end_row();
                }
            });
        });
}

/// Bytes for people.
fn size(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.0} kB", bytes as f64 * 1e-3),
        _ => format!("{:.1} MB", bytes as f64 * 1e-6),
    }
}
