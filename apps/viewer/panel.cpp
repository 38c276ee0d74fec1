#include "apps/viewer/panel.h"

#include <fmt/format.h>
#include <imgui.h>

namespace tessera {
namespace {

void factRow(const std::string& name, const std::string& value) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextDisabled("%s", name.c_str());
  ImGui::TableNextColumn();
  ImGui::PushTextWrapPos(0);
  ImGui::TextUnformatted(value.c_str());
  ImGui::PopTextWrapPos();
}

void modeButton(const char* name, NavigationMode mode, Navigation& navigation) {
  if (ImGui::RadioButton(name, navigation.mode() == mode)) navigation.setMode(mode);
}

int chooseView(const std::vector<NamedView>& views, int current) {
  int wished = -1;
  const char* shown = current >= 0 ? views[static_cast<size_t>(current)].name.c_str() : "choose a view";
  ImGui::SetNextItemWidth(-1);
  if (ImGui::BeginCombo("##view", shown)) {
    for (int i = 0; i < static_cast<int>(views.size()); ++i) {
      if (ImGui::Selectable(views[static_cast<size_t>(i)].name.c_str(), i == current)) wished = i;
    }
    ImGui::EndCombo();
  }
  return wished;
}

}  // namespace

PanelAction showPanel(const std::string& title, Navigation& navigation, const std::vector<NamedView>& views,
                      const FrameSource::Facts& facts, PanelState& state) {
  PanelAction action;
  const float unit = ImGui::GetFontSize();
  ImGui::SetNextWindowPos({unit, unit}, ImGuiCond_FirstUseEver);
  ImGui::SetNextWindowSize({26 * unit, 0}, ImGuiCond_Always);
  ImGui::SetNextWindowBgAlpha(0.75f);
  ImGui::Begin((title + "###panel").c_str(), nullptr,
               ImGuiWindowFlags_NoFocusOnAppearing | ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoResize);
  modeButton("Map (1)", NavigationMode::map, navigation);
  ImGui::SameLine();
  modeButton("Orbit (2)", NavigationMode::orbit, navigation);
  ImGui::SameLine();
  modeButton("Fly (3)", NavigationMode::fly, navigation);
  ImGui::SameLine();
  if (ImGui::Button("All (H)")) action.all = true;
  ImGui::SetNextItemWidth(-7 * unit);
  ImGui::SliderFloat("Lens, degrees", &state.fieldOfView, 15, 110, "%.0f", ImGuiSliderFlags_AlwaysClamp);
  if (!views.empty()) action.view = chooseView(views, state.view);

  if (ImGui::CollapsingHeader("Statistics", ImGuiTreeNodeFlags_DefaultOpen) && ImGui::BeginTable("facts", 2)) {
    ImGui::TableSetupColumn("name", ImGuiTableColumnFlags_WidthFixed);
    ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthStretch);
    if (state.milliseconds > 0) {
      factRow("Moving",
              fmt::format("{:.1f} frames per second, {:.1f} ms", 1000 / state.milliseconds, state.milliseconds));
    }
    for (const auto& [name, value] : facts) factRow(name, value);
    factRow("Complete", state.isComplete ? "yes" : "not yet");
    const Vec3d& eye = navigation.look().eye;
    factRow("Camera", fmt::format("{:.2f}, {:.2f}, {:.2f}", eye.x(), eye.y(), eye.z()));
    if (navigation.mode() == NavigationMode::fly) factRow("Speed", fmt::format("{:.3g} a second", navigation.speed()));
    ImGui::EndTable();
  }
  if (ImGui::CollapsingHeader("Keys")) {
    ImGui::TextUnformatted(
        "Drag          move, turn or look\n"
        "Right drag    turn; in orbit: move\n"
        "Wheel         nearer, farther; in flight: speed\n"
        "Double click  go there\n"
        "W A S D Q E   move, down, up; Shift: faster\n"
        "1 2 3         map, orbit, fly\n"
        "H             all\n"
        "N B           next view, the one before\n"
        "F1            hide this");
  }
  ImGui::End();
  return action;
}

}  // namespace tessera
