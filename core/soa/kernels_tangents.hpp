#pragma once
// The sweeps of inverse dynamics on numbers that carry their derivatives along eight directions (tangent.hpp), for each instruction set.
// What families give along them is in kernels_tangent.cpp: direction by direction.
#include "core/soa/kernels_kinematics.hpp"
#include "core/soa/tangent.hpp"

namespace cardan::soa {

void family_records(const SweepModel& model, Workspace<Tangents>& ws, const Inputs<Tangents>& in, const DenseBatch& batch);
void family_inertia(const FlexibleBody& f, int m, const Tangents* eta, const Tangents* etadot, const Vec3<Tangents>& w,
                    Modal<Tangents>& modal, Tangents* M_rr);

}  // namespace cardan::soa
