#pragma once
// A linear model in a file for other programs: .h5 (HDF5), .m (a script for Octave or Matlab), .json. All hold the matrices A, B, C, D,
// the drift, u0, y0, the time, and names and units of states, inputs and outputs.
#include "core/operators/linear_model.hpp"

namespace cardan {

/// By the ending of `path`. InputError C0701 for another ending or where the file cannot be written; N0108 for a number that is not finite.
void write_linear_model(const operators::LinearModel& model, const std::string& path);

// The texts.
std::string linear_model_script(const operators::LinearModel& model);  ///< .m
std::string linear_model_json(const operators::LinearModel& model);

}  // namespace cardan
