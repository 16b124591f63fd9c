#pragma once
// Standard input, output and error of the program: what becomes of them never harms results.
#include <string_view>

namespace cardan {

/// At the start: a descriptor of the three that is closed gets /dev/null, so that no result file takes its number; a reader of a pipe
/// that goes away is no reason to die (SIGPIPE is ignored).
void open_standard_streams();

/// Lines on standard output or standard error, at once visible, with a '?' for control characters that names and arguments may hold;
/// what cannot be written is left out.
void say(std::string_view text);
void complain(std::string_view text);
/// On standard error, with control characters that move the cursor.
void draw(std::string_view text);

/// A write to standard output by other means failed, with this errno.
void note_output_fault(int error);

/// At the end of a command: writes out what standard output still holds. Empty where all of it went out, or where nobody reads any more (a
/// pipe whose reader has ended); else why it did not.
std::string_view output_fault();

}  // namespace cardan
