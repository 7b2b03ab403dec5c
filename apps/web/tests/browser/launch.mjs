// The browser, drawing in software.

import { chromium } from "playwright-core";

// For both interfaces; leaving one out loses WebGPU's device or WebGL2.
const FLAGS = [
  "--no-sandbox",
  "--enable-unsafe-webgpu",
  "--use-webgpu-adapter=swiftshader",
  "--enable-features=Vulkan",
  "--use-vulkan=swiftshader",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--ignore-gpu-blocklist",
];

export const launch = (executablePath, flags) =>
  chromium.launch({ executablePath, headless: true, args: flags ?? FLAGS });
