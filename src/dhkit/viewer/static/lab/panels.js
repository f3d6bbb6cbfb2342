// The panels of a lab that Python answers.

import { ControlPanel } from "./control.js";
import { DynamicsPanel } from "./dynamics.js";
import { JointPanel } from "./joints.js";
import { MotionPanel } from "./motion.js";
import { OwnPanel } from "./own.js";
import { SubmitPanel } from "./submit.js";
import { TaskPanel } from "./task.js";
import { TablePanel } from "./table.js";
import { ToolPanel } from "./tool.js";
import { TransformsPanel } from "./transforms.js";
import { WorkspacePanel } from "./workspace.js";

export const PANELS = [
  ["task", "Task", TaskPanel],
  ["joints", "Joints", JointPanel],
  ["tool", "Tool", ToolPanel],
  ["table", "DH table", TablePanel],
  ["motion", "Motion", MotionPanel],
  ["control", "Control", ControlPanel],
  ["dynamics", "Dynamics", DynamicsPanel],
  ["workspace", "Workspace", WorkspacePanel],
  ["transforms", "Transforms", TransformsPanel],
  ["submit", "Submit", SubmitPanel],
  ["own", "Yours", OwnPanel],
];
