// The panels of a page without Python.

import { JointPanel } from "../lab/joints.js";
import { TablePanel } from "../lab/table.js";
import { ToolPanel } from "../lab/tool.js";
import { AboutPanel } from "./about.js";
import { RecordedPanel } from "./recorded.js";

export const PANELS = [
  [["about", "About", AboutPanel]],
  [
    ["joints", "Joints", JointPanel],
    ["tool", "Tool", ToolPanel],
    ["recorded", "Motions", RecordedPanel],
  ],
  [["table", "DH table", TablePanel]],
];
