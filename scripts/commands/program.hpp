#pragma once

namespace cardan {

/// What `cardan` does with its arguments. Exit codes: 0 done, 1 a check failed, 2 wrong input, 3 numerics, 4 a result could not be written,
/// 70 a fault of ours, 128 + n ended by signal n.
int run_command_line(int argc, char** argv);

}  // namespace cardan
