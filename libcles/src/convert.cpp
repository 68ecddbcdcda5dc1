// SPDX-License-Identifier: BSL-1.0
#include <cles/convert.hpp>

namespace cles::detail {

void write_text(json_writer& w, std::string_view json) {
    std::string why;
    if (!is_valid_json(json, 32, &why)) {
        throw error(errc::failed, "the text to send is not JSON: " + why);
    }
    std::string compact;
    append_compact_json(json, compact);
    w.raw(compact);
}

} // namespace cles::detail
