// SPDX-License-Identifier: BSL-1.0
#include "frame_codec.hpp"

#include "base64.hpp"

#if CLES_JPEG
#include <memory>

#include <turbojpeg.h>
#endif

#include <cstdint>
#include <stdexcept>
#include <vector>

namespace fmv {

#if CLES_JPEG

namespace {

struct destroyer {
    void operator()(void* codec) const { tjDestroy(codec); }
};
using codec = std::unique_ptr<void, destroyer>;

std::vector<std::uint8_t> to_jpeg(const grey& picture, extent size, int quality) {
    const codec c{tjInitCompress()};
    std::vector<std::uint8_t> out(tjBufSize(size.width, size.height, TJSAMP_GRAY));
    auto* at = out.data();
    unsigned long length = out.size();
    if (!c || tjCompress2(c.get(), picture.data(), size.width, 0, size.height, TJPF_GRAY, &at, &length, TJSAMP_GRAY,
                          quality, TJFLAG_NOREALLOC) != 0) {
        throw std::runtime_error("a picture cannot be compressed");
    }
    out.resize(length);
    return out;
}

std::optional<grey> from_jpeg(const std::vector<std::uint8_t>& bytes, extent size) {
    const codec c{tjInitDecompress()};
    int width = 0;
    int height = 0;
    int sampling = 0;
    int colours = 0;
    if (!c || tjDecompressHeader3(c.get(), bytes.data(), bytes.size(), &width, &height, &sampling, &colours) != 0 ||
        extent{.width = width, .height = height} != size) {
        return std::nullopt;
    }
    grey out(size.pixels());
    // Without the limit, a small picture in many passes takes minutes.
    if (tjDecompress2(c.get(), bytes.data(), bytes.size(), out.data(), width, 0, height, TJPF_GRAY,
                      TJFLAG_LIMITSCANS) != 0) {
        return std::nullopt;
    }
    return out;
}

} // namespace

bool has_jpeg() noexcept { return true; }

#else

namespace {

std::vector<std::uint8_t> to_jpeg(const grey& /*picture*/, extent /*size*/, int /*quality*/) {
    throw std::runtime_error("this program is built without libjpeg-turbo");
}

std::optional<grey> from_jpeg(const std::vector<std::uint8_t>& /*bytes*/, extent /*size*/) { return std::nullopt; }

} // namespace

bool has_jpeg() noexcept { return false; }

#endif

std::string encode(const grey& picture, extent size, std::string_view format, int quality) {
    return to_base64(format == "jpeg" ? to_jpeg(picture, size, quality) : picture);
}

std::optional<grey> decode(std::string_view text, extent size, std::string_view format) {
    if (format != "jpeg") {
        return from_base64(text, size.pixels());
    }
    const auto bytes = from_base64(text, base64_size(text));
    return bytes ? from_jpeg(*bytes, size) : std::nullopt;
}

} // namespace fmv
