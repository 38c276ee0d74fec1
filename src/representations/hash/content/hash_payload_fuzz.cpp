// Decodes hash contents from arbitrary bytes. Memory stays bounded, and every accepted content satisfies the rules and
// survives a round trip.
#include "representations/hash/content/hash_payload.h"
#include "tiles/testing/content_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace tessera;
  fuzzContent(
      data, size, decodedHashBytes, decodeHash, [](const HashContent& content) { return encodeHash(content, 0); },
      [](const HashPart& a, const HashPart& b) {
        if (a.tables.size() != b.tables.size()) return false;
        for (size_t l = 0; l < a.tables.size(); ++l) {
          if (a.tables[l].bytes != b.tables[l].bytes) return false;
        }
        return a.cornerBytes == b.cornerBytes && a.occupied.levels == b.occupied.levels && a.distances == b.distances;
      });
  return 0;
}
