// The panels of a lab that Python answers.

import { ControlPanel } from "./control.js";
import { JointPanel } from "./joints.js";
import { MotionPanel } from "./motion.js";
import { OwnPanel } from "./own.js";
import { TablePanel } from "./table.js";
import { ToolPanel } from "./tool.js";

export const PANELS = [
  ["joints", "Joints", JointPanel],
  ["tool", "Tool", ToolPanel],
  ["table", "DH table", TablePanel],
  ["motion", "Motion", MotionPanel],
  ["control", "Control", ControlPanel],
  ["own", "Yours", OwnPanel],
];
