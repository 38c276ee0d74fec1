// Fuzzes the decoder of volume contents: memory stays bounded, and accepted contents keep the rules and survive
// re-encoding.
#include "representations/volume/content/volume_payload.h"
#include "tiles/testing/content_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace tessera;
  fuzzContent(
      data, size, decodedVolumeBytes, decodeVolume,
      [](const VolumeContent& content) { return encodeVolume(content, 0); },
      [](const VolumePart& a, const VolumePart& b) {
        return a.voxelBytes == b.voxelBytes && a.planeBytes == b.planeBytes && a.distances == b.distances;
      });
  return 0;
}
