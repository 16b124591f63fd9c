#pragma once
// The kinds of families that a plugin may hold, and all that the loader needs of each: a new kind is one entry in kinds.cpp.
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/abi/law_record.hpp"
#include "core/abi/registry.hpp"
#include "core/abi/trial.hpp"

namespace cardan {

/// A table as the host keeps it: of full size whatever the plugin was built with, until the process ends.
struct KeptTable {
  const void* table = nullptr;
  std::string fault;  // why there is none: "struct_size: ..."
};

struct FamilyKind {
  const char* kind;  // what a plugin is asked for: "hinge"
  const char* word;  // in messages
  /// Copies a plugin's table by its struct_size, and the descriptions of its parameters by theirs: what an older contract did not have
  /// is zero, what a newer one has more is left out. The same table gives the same copy.
  KeptTable (*keep)(const void* theirs);
  const char* (*type)(const void* table);
  const char* (*summary)(const void* table);
  /// The functions on kept tables: what is wrong with the table as such; with that and with the laws; registration.
  std::vector<std::string> (*faults)(const void* table);
  std::vector<std::string> (*violations)(const void* table, int samples, std::uint64_t seed, const TellPhase& before, LawRecord* record);
  bool (*known)(const Registry&, const void* table);
  void (*add)(Registry&, const void* table, const std::string& origin, const Located& at);
};

std::span<const FamilyKind> family_kinds();

/// A kind that has its name and its form, and that no part of this version honours: a plugin that brings one is refused (C0605).
struct DeclaredKind {
  const char* kind;
  const char* word;
};
std::span<const DeclaredKind> declared_kinds();

}  // namespace cardan
