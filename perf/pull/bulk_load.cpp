// SPDX-License-Identifier: BSL-1.0
#include "bulk_load.hpp"

#include <stdexcept>

namespace cles::perf {

void register_bulk(cles::registrar& tasks) {
    tasks.on_pull("bulk",
                  [text = std::string(bulk_bytes, 'x')](const cles::request&) -> const std::string& { return text; });
}

void bulk_load::start(std::size_t in_flight) {
    over_ = false;
    while (in_flight_ < in_flight) {
        ++in_flight_;
        ask();
    }
}

void bulk_load::ask() {
    client_.async_pull<std::string>(noun_, [this](boost::system::error_code code, const std::string& text) {
        if (code || text.size() != bulk_bytes) {
            --in_flight_;
            if (code != errc::stopped) {
                throw std::runtime_error("the PULL of " + noun_ + " failed: " + code.message());
            }
        } else if (over_) {
            --in_flight_;
        } else {
            ask();
        }
    });
}

} // namespace cles::perf
