#include "gpu/context.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <optional>

#include "gpu/physical_device.h"
#include "gpu/testing/test_context.h"

namespace tessera {
namespace {

// Sets an environment variable during its lifetime.
class Environment {
 public:
  Environment(const char* name, const char* value) : name_(name) {
    if (const char* before = std::getenv(name)) before_ = before;
    setenv(name, value, 1);
  }
  ~Environment() { before_ ? setenv(name_, before_->c_str(), 1) : unsetenv(name_); }

 private:
  const char* name_;
  std::optional<std::string> before_;
};

PhysicalDevice device(const char* name, VkPhysicalDeviceType type) {
  PhysicalDevice physicalDevice;
  std::snprintf(physicalDevice.properties.deviceName, sizeof physicalDevice.properties.deviceName, "%s", name);
  physicalDevice.properties.deviceType = type;
  physicalDevice.properties.apiVersion = VK_API_VERSION_1_2;
  return physicalDevice;
}

const std::vector<PhysicalDevice> kDevices = {device("llvmpipe", VK_PHYSICAL_DEVICE_TYPE_CPU),
                                              device("Intel Arc", VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU),
                                              device("NVIDIA RTX", VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU),
                                              device("AMD Radeon", VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU)};

std::string physicalDeviceName(const PhysicalDevice& chosen) {
  return chosen.properties.deviceName;
}

TEST(PhysicalDevice, IsTheFirstDiscreteGpuByDefault) {
  EXPECT_EQ(physicalDeviceName(choosePhysicalDevice(kDevices, "")), "NVIDIA RTX");
}

TEST(PhysicalDevice, FallsBackToTheCpu) {
  EXPECT_EQ(physicalDeviceName(choosePhysicalDevice({kDevices[0]}, "")), "llvmpipe");
}

TEST(PhysicalDevice, IsFoundByPartOfItsNameOrItsIndex) {
  EXPECT_EQ(physicalDeviceName(choosePhysicalDevice(kDevices, "radeon")), "AMD Radeon");
  EXPECT_EQ(physicalDeviceName(choosePhysicalDevice(kDevices, "1")), "Intel Arc");
}

TEST(PhysicalDevice, IsFoundByIndexEvenIfNamesContainNumbers) {
  const std::vector<PhysicalDevice> gpus = {device("H100", VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU),
                                            device("H101", VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU)};
  EXPECT_EQ(physicalDeviceName(choosePhysicalDevice(gpus, "1")), "H101");
  EXPECT_EQ(physicalDeviceName(choosePhysicalDevice(gpus, "101")), "H101") << "no index";
  EXPECT_THROW(choosePhysicalDevice(gpus, "2"), Error);
}

TEST(PhysicalDevice, IsAUsableOneIfThereIsAny) {
  std::vector<PhysicalDevice> gpus = kDevices;
  gpus[2].missing = gpus[3].missing = "no Vulkan 1.2";
  EXPECT_EQ(physicalDeviceName(choosePhysicalDevice(gpus, "")), "Intel Arc");
}

TEST(PhysicalDevice, ListsTheAvailableDevicesIfTheRequestedOneIsMissing) {
  try {
    choosePhysicalDevice(kDevices, "voodoo");
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_NE(error.remedy().find("0 llvmpipe, 1 Intel Arc"), std::string::npos) << error.what();
  }
}

TEST(PhysicalDevice, IsRejectedIfItsDriverIsTooOld) {
  PhysicalDevice old = kDevices[2];
  old.properties.apiVersion = VK_API_VERSION_1_1;
  EXPECT_THROW(requireFeatures(old), Error);
}

TEST(GpuContext, OpensTheBestDevice) {
  const auto context = openForTest();
  SKIP_WITHOUT_VULKAN(context);
  EXPECT_NE(context->device(), VkDevice(VK_NULL_HANDLE));
  EXPECT_FALSE(context->name().empty());
  EXPECT_EQ(context->target().rfind("vulkan/", 0), 0u) << context->target();
}

TEST(GpuContext, ValidatesWhereTheEnvironmentAsksForIt) {
  const Environment validation("TESSERA_VULKAN_VALIDATION", "1");
  const auto context = openForTest();
  SKIP_WITHOUT_VULKAN(context);
  if (!context->validates() && !vulkanIsRequired())
    GTEST_SKIP() << "the package vulkan-validationlayers is not installed";
  EXPECT_TRUE(context->validates());
}

TEST(GpuContext, ListsTheDevicesOfThisMachine) {
  SKIP_WITHOUT_VULKAN(openForTest());
  const std::vector<GpuDescription> devices = GpuContext::devices();
  ASSERT_FALSE(devices.empty());
  for (const GpuDescription& device : devices) {
    EXPECT_FALSE(device.name.empty());
    EXPECT_GT(device.memoryBytes, 0u);
  }
}

TEST(GpuContext, LeavesOutFeaturesThatAreNotAllowed) {
  GpuOptions options;
  options.allowed = {.floatAtomics = false, .float64 = false, .float16 = false, .subgroups = false, .matrices = false};
  const auto context = openForTest(options);
  SKIP_WITHOUT_VULKAN(context);
  EXPECT_FALSE(context->features().floatAtomics);
  EXPECT_FALSE(context->features().float64);
  EXPECT_FALSE(context->features().float16);
  EXPECT_FALSE(context->features().subgroups);
  EXPECT_FALSE(context->features().matrices);
}

TEST(GpuContext, DisablesMatricesWithoutFloat16) {
  GpuOptions options;
  options.allowed.float16 = false;
  const auto context = openForTest(options);
  SKIP_WITHOUT_VULKAN(context);
  EXPECT_FALSE(context->features().matrices);
}

TEST(GpuContext, LeavesOutFeaturesThatTheEnvironmentForbids) {
  const Environment without("TESSERA_GPU_WITHOUT", "floatAtomics");
  const auto context = openForTest();
  SKIP_WITHOUT_VULKAN(context);
  EXPECT_FALSE(context->features().floatAtomics);
}

TEST(GpuContext, SaysWhatToInstallWithoutADriver) {
  const Environment oldName("VK_ICD_FILENAMES", "/nonexistent/driver.json");
  const Environment newName("VK_DRIVER_FILES", "/nonexistent/driver.json");
  try {
    GpuContext::open();
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_EQ(error.reason(), "no Vulkan driver is installed");
    EXPECT_NE(error.remedy().find("mesa-vulkan-drivers"), std::string::npos);
  }
}

TEST(GpuContext, RejectsAMissingDevice) {
  SKIP_WITHOUT_VULKAN(openForTest());
  GpuOptions options;
  options.device = "no such device";
  EXPECT_THROW(GpuContext::open(options), Error);
}

}  // namespace
}  // namespace tessera
