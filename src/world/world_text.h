// Texts in world.json: addresses, base64.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "base/file.h"

namespace tessera {

// Returns whether an address has a scheme, such as https, or names another server.
bool isOfNetwork(std::string_view address);
// Returns whether an address has a scheme other than http and https.
bool hasOtherScheme(std::string_view address);
// Returns the length as the browser counts it, in units of UTF-16. `text` is UTF-8.
size_t countCharacters(std::string_view text);
// Returns the text without spaces at its ends.
std::string_view trimmed(std::string_view text);
// Replaces %20 and the like by the bytes that they stand for; an invalid sequence stays as it is.
std::string decodePercent(std::string_view text);
// Returns nothing if the text is not base64. Line breaks and spaces are ignored.
std::optional<Bytes> decodeBase64(std::string_view text);
bool isDataUri(std::string_view address);
// Returns the content of an address that states it (data:…;base64,…); nothing if it is not base64.
std::optional<Bytes> decodeDataUri(std::string_view address);

}  // namespace tessera
