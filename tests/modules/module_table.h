// The table of modules in ARCHITECTURE.md, which says what each may include.
//
//   | module | may use | ... |
//   | `render`, `raymarch/cpu` | base, scene; `vulkan/` and `make_device.cpp` also gpu | ... |
//
// A module is a folder below src/, or one of apps/ with that prefix. A file belongs to the row with the longest folder
// that holds it; of two as long, to the one that spells its name out. `<name>` in a folder stands for any one name, and
// for the same one in what the row may use. "also" widens that for some files or folders of the module. "all" is
// everything below src/, and "—" nothing. A name that ends in ".h" allows that header alone.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

struct ModuleRow {
  std::string folder;             // "representations/<name>/cpu"
  std::vector<std::string> uses;  // as written: "all", "base", "apps/tessera/drawable.h"
  struct Also {
    std::string path;  // below `folder`: "vulkan/" or "make_device.cpp"
    std::vector<std::string> uses;
  };
  std::vector<Also> also;
};

class ModuleTable {
 public:
  // Of the first table below the heading that says "bottom to top". Throws Error where there is none, or where a row
  // may use what no row is.
  static ModuleTable parse(std::string_view markdown);

  // The folder of the module that a file belongs to, with real names in place of `<name>`; empty: of none. Paths are
  // those of includes: "compute/device.h", "apps/tessera/main.cpp".
  std::string moduleOf(const std::string& file) const;
  // What the file may include beside its own module: folders of modules, "all", headers.
  std::vector<std::string> usesOf(const std::string& file) const;
  // Which of its row's words forbid it to include `header`; empty where they do not.
  std::string brokenRule(const std::string& file, const std::string& header) const;

 private:
  using Names = std::map<std::string, std::string>;  // "<name>" → what it stands for
  const ModuleRow* rowOf(const std::string& file, Names& names) const;

  std::vector<ModuleRow> rows_;
};

}  // namespace tessera
