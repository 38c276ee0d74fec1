#include "apps/viewer/interface.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "shaders/interface.h"
#include "shaders/interface_triangles.h"
#include "shaders/window/arguments_window.h"

namespace tessera {
namespace {

constexpr float kFontPixels = 15;
constexpr double kLongestStep = 0.1;  // seconds of navigation per frame, at most

// The layout that the shaders expect.
static_assert(sizeof(ImDrawVert) == 20 && sizeof(ImDrawIdx) == 2);

template <class T>
std::span<const std::byte> asBytes(const ImVector<T>& values) {
  return std::as_bytes(std::span(values.Data, static_cast<size_t>(values.Size)));
}

}  // namespace

Interface::Interface(Window& window, const std::shared_ptr<const GpuContext>& context, VkRenderPass renderPass)
    : window_(window), pipeline_(context, renderPass, kInterfaceTrianglesSpirv, kInterfaceSpirv) {
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;  // do not write a settings file
  io.BackendFlags |= ImGuiBackendFlags_RendererHasVtxOffset;
  ImGui_ImplGlfw_InitForVulkan(window.handle(), true);
  ImGui::StyleColorsDark();
  // Dear ImGui measures in the desktop's units, which may be larger than a pixel; fonts are rasterised in pixels.
  const float scale = window.contentScale(), unit = window.unitsOfPixel();
  ImGui::GetStyle().ScaleAllSizes(scale * unit);
  ImGui::GetStyle().WindowRounding = 4 * scale * unit;
  io.FontGlobalScale = unit;
  ImFontConfig font;
  font.SizePixels = std::round(kFontPixels * scale);
  font.OversampleH = font.OversampleV = 1;
  font.PixelSnapH = true;
  io.Fonts->AddFontDefault(&font);
  unsigned char* texels = nullptr;
  int width = 0, height = 0;
  io.Fonts->GetTexDataAsAlpha8(&texels, &width, &height);
  fontWidth_ = static_cast<uint32_t>(width);
  fontHeight_ = static_cast<uint32_t>(height);
  const size_t bytes = static_cast<size_t>(width) * static_cast<size_t>(height);
  font_ = GpuBuffer(context, (bytes + 3) / 4 * 4, BufferUse::upload);
  std::memcpy(font_.mapped(), texels, bytes);
}

Interface::~Interface() {
  ImGui_ImplGlfw_Shutdown();
  ImGui::DestroyContext();
}

void Interface::begin() {
  ImGui_ImplGlfw_NewFrame();
  ImGui::NewFrame();
  pressed_ = window_.takePressed();
}

Moves Interface::moves() const {
  const ImGuiIO& io = ImGui::GetIO();
  Moves moves;
  moves.seconds = std::min(static_cast<double>(io.DeltaTime), kLongestStep);  // longer gaps are pauses of the window
  const double height = std::max(1.0f, io.DisplaySize.y);
  if (!io.WantCaptureMouse) {
    if (ImGui::IsMouseDown(ImGuiMouseButton_Left)) {
      moves.drag = Moves::Drag::left;
    } else if (ImGui::IsMouseDown(ImGuiMouseButton_Right)) {
      moves.drag = Moves::Drag::right;
    } else if (ImGui::IsMouseDown(ImGuiMouseButton_Middle)) {
      moves.drag = Moves::Drag::middle;
    }
    moves.dragRight = io.MouseDelta.x / height;
    moves.dragDown = io.MouseDelta.y / height;
    moves.wheel = io.MouseWheel;
  }
  if (!io.WantTextInput && !io.KeyCtrl && !io.KeyAlt && !io.KeySuper) {
    const auto axisInput = [&](int key, int other) { return window_.isHeld(key) || window_.isHeld(other) ? 1.0 : 0.0; };
    moves.right = axisInput(GLFW_KEY_D, GLFW_KEY_RIGHT) - axisInput(GLFW_KEY_A, GLFW_KEY_LEFT);
    moves.up = axisInput(GLFW_KEY_E, GLFW_KEY_PAGE_UP) - axisInput(GLFW_KEY_Q, GLFW_KEY_PAGE_DOWN);
    moves.forward = axisInput(GLFW_KEY_W, GLFW_KEY_UP) - axisInput(GLFW_KEY_S, GLFW_KEY_DOWN);
    moves.fast = io.KeyShift;
  }
  return moves;
}

std::optional<Vec2d> Interface::doubleClick() const {
  const ImGuiIO& io = ImGui::GetIO();
  if (io.WantCaptureMouse || !ImGui::IsMouseDoubleClicked(ImGuiMouseButton_Left)) return std::nullopt;
  return Vec2d(io.MousePos.x / std::max(1.0f, io.DisplaySize.x), io.MousePos.y / std::max(1.0f, io.DisplaySize.y));
}

bool Interface::pressed(int key) const {
  return !ImGui::GetIO().WantTextInput && std::find(pressed_.begin(), pressed_.end(), key) != pressed_.end();
}

void Interface::end() {
  ImGui::Render();
}

void Interface::paint(GpuPresenter& presenter) const {
  const ImDrawData* data = ImGui::GetDrawData();
  if (data == nullptr || data->DisplaySize.x <= 0 || data->DisplaySize.y <= 0) return;
  arguments::InterfaceArguments drawn = {};
  drawn.font = font_.address();
  drawn.fontWidth = fontWidth_;
  drawn.fontHeight = fontHeight_;
  drawn.low[0] = data->DisplayPos.x;
  drawn.low[1] = data->DisplayPos.y;
  drawn.scale[0] = 2 / data->DisplaySize.x;
  drawn.scale[1] = 2 / data->DisplaySize.y;
  const VkExtent2D extent = presenter.extent();
  for (int i = 0; i < data->CmdListsCount; ++i) {
    const ImDrawList& list = *data->CmdLists[i];
    if (list.IdxBuffer.empty()) continue;
    drawn.vertices = presenter.stage(asBytes(list.VtxBuffer));
    // The shader reads two 16-bit indices at a time.
    std::vector<ImDrawIdx> indices(list.IdxBuffer.begin(), list.IdxBuffer.end());
    indices.resize((indices.size() + 1) / 2 * 2);
    drawn.indices = presenter.stage(std::as_bytes(std::span(indices)));
    for (const ImDrawCmd& command : list.CmdBuffer) {
      const auto inside = [](float at, float low, float scale, uint32_t maximum) {
        return static_cast<int32_t>(std::clamp((at - low) * scale, 0.0f, static_cast<float>(maximum)));
      };
      const ImVec2 low = data->DisplayPos, scale = data->FramebufferScale;
      VkRect2D where = {};
      where.offset = {inside(command.ClipRect.x, low.x, scale.x, extent.width),
                      inside(command.ClipRect.y, low.y, scale.y, extent.height)};
      const int32_t right = inside(command.ClipRect.z, low.x, scale.x, extent.width);
      const int32_t bottom = inside(command.ClipRect.w, low.y, scale.y, extent.height);
      if (right <= where.offset.x || bottom <= where.offset.y) continue;
      where.extent = {static_cast<uint32_t>(right - where.offset.x), static_cast<uint32_t>(bottom - where.offset.y)};
      drawn.firstIndex = command.IdxOffset;
      drawn.firstVertex = command.VtxOffset;
      presenter.draw(pipeline_, std::as_bytes(std::span(&drawn, 1)), command.ElemCount, where);
    }
  }
}

}  // namespace tessera
