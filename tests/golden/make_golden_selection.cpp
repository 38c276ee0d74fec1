// Prints selection.json. Run it again only when the selection is meant to change, and say so in the commit.
#include <cstdio>

#include "golden/golden_selection.h"

int main() {
  const nlohmann::ordered_json selections = tessera::golden::makeSelections();
  nlohmann::ordered_json head = selections;
  head.erase("views");
  std::string text = head.dump();
  text.pop_back();
  text += ",\"views\":[";
  for (size_t i = 0; i < selections["views"].size(); ++i)
    text += (i == 0 ? "\n" : ",\n") + selections["views"][i].dump();
  std::puts((text + "\n]}").c_str());
  return 0;
}
