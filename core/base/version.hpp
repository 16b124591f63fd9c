#pragma once
// What this program was built from and how; CMake fills in version.cpp, and each result names it.
namespace cardan::version {
extern const char* const kNumber;
extern const char* const kCommit;  // "" where there is none
extern const char* const kCompiler;
extern const char* const kFlags;       // of all but the sweeps
extern const char* const kSweepFlags;  // what those have beyond: they override what stands in kFlags
}  // namespace cardan::version
