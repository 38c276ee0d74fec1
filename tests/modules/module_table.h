// Parses the table of modules in ARCHITECTURE.md, which states what each module may include.
//
//   | module | may use | ... |
//   | `render`, `raymarch/cpu` | base, scene; `vulkan/` and `make_device.cpp` also gpu | ... |
//
// A module is a folder below src/, or a path below apps/. A file belongs to the row with the longest folder that
// contains it; of two equally long ones, to the one without placeholders. `<name>` in a folder stands for any one name,
// and for the same name in what the row may use. "also" extends this for some files or folders of the module. "all"
// means everything below src/, and "—" means nothing. A name that ends in ".h" allows that header alone.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

struct ModuleRow {
  std::string folder;             // "representations/<name>/cpu"
  std::vector<std::string> uses;  // as written: "all", "base", "apps/tessera/render_source.h"
  struct Also {
    std::string path;  // below `folder`: "vulkan/" or "make_device.cpp"
    std::vector<std::string> uses;
  };
  std::vector<Also> also;
};

class ModuleTable {
 public:
  // Parses the first table below the heading that contains "bottom to top". Throws Error if there is none, or if a row
  // may use a module that has no row.
  static ModuleTable parse(std::string_view markdown);

  // Returns the folder of the module that a file belongs to, with actual names in place of `<name>`; empty if it
  // belongs to none. Paths are spelt as in includes: "compute/device.h", "apps/tessera/main.cpp".
  std::string findModule(const std::string& file) const;
  // Returns what the file may include besides its own module: folders of modules, "all", headers.
  std::vector<std::string> allowedIncludes(const std::string& file) const;
  // Returns a message if the file's row forbids it to include `header`; empty if it is allowed.
  std::string validationError(const std::string& file, const std::string& header) const;

 private:
  using Names = std::map<std::string, std::string>;  // "<name>" → what it stands for
  const ModuleRow* findRow(const std::string& file, Names& names) const;

  std::vector<ModuleRow> rows_;
};

}  // namespace tessera
