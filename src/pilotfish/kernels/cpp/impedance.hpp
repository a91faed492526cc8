// Cartesian impedance control of an arm. Defined by kernels/reference/impedance.py.
#pragma once

namespace pilotfish {

constexpr int MAX_JOINTS = 16;  // fixed size: no allocation

// Arguments as in kernels/arm_types.py, for n joints; the Jacobian is row-major.
struct Arm {
  int n;
  const double *stiffness, *damping, *posture;  // ImpedanceParameters
  double posture_stiffness, joint_damping, force_limit, moment_limit, min_singular_value, limit_margin,
      limit_stiffness;
  const double *lower, *upper, *torque;                                  // ArmLimits
  const double *q, *velocity, *position, *quaternion, *jacobian, *bias;  // ArmState
  const double *target_position, *target_quaternion, *twist;             // ToolTarget
};

// Writes torque (n) and wrench (6); returns the smallest fraction of its torque that a joint could apply.
double impedance_torque(const Arm& arm, double* torque, double* wrench);

}  // namespace pilotfish
