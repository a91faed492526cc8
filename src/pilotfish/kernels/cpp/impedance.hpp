// The torques with which an arm's tool is held by springs and dampers; its twin says what they are.
#pragma once

namespace pilotfish {

constexpr int MAX_JOINTS = 16;  // so nothing is allocated

// Fields as in kernels/arms.py; n joints, the Jacobian row-major.
struct Arm {
  int n;
  const double *stiffness, *damping, *posture;                              // Impedance
  double posture_stiffness, joint_damping, force_limit, moment_limit, min_singular_value, limit_margin,
      limit_stiffness;
  const double *lower, *upper, *torque;                                     // ArmLimits
  const double *q, *velocity, *position, *quaternion, *jacobian, *bias;     // ArmReading
  const double *target_position, *target_quaternion, *twist;                // ToolTarget
};

// Fills torque (n) and wrench (6); returns the least share of its push that a joint could give.
double impedance(const Arm& arm, double* torque, double* wrench);

}  // namespace pilotfish
