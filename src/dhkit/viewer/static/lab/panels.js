// The panels of a lab that Python answers.

import { ControlPanel } from "./control.js";
import { DynamicsPanel } from "./dynamics.js";
import { JointPanel } from "./joints.js";
import { MotionPanel } from "./motion.js";
import { OwnPanel } from "./own.js";
import { AnswersPanel } from "./answers.js";
import { Redundancy } from "./redundancy.js";
import { TaskPanel } from "./task.js";
import { TablePanel } from "./table.js";
import { ToolPanel } from "./tool.js";
import { TransformsPanel } from "./transforms.js";
import { WorkspacePanel } from "./workspace.js";

class ToolPanelWithRedundancy extends ToolPanel {
  constructor(lab, root) {
    super(lab, root, Redundancy);
  }
}

// In groups: an assignment, to move the arm, its model, its simulation, and to learn.
export const PANELS = [
  [["task", "Task", TaskPanel]],
  [
    ["joints", "Joints", JointPanel],
    ["tool", "Tool", ToolPanelWithRedundancy],
    ["motion", "Motion", MotionPanel],
  ],
  [
    ["table", "DH table", TablePanel],
    ["dynamics", "Dynamics", DynamicsPanel],
    ["workspace", "Workspace", WorkspacePanel],
  ],
  [["control", "Control", ControlPanel]],
  [
    ["transforms", "Transforms", TransformsPanel],
    ["answers", "Answers", AnswersPanel],
    ["own", "My code", OwnPanel],
  ],
];
