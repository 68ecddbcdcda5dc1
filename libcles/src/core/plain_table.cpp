// SPDX-License-Identifier: BSL-1.0
#include "core/plain_table.hpp"

#include "core/announcement.hpp"

#include <string_view>

namespace cles::core {

void write_peers(json_writer& w, const presence& others, time_point now) {
    w.begin_object();
    w.plain_key("peers");
    w.begin_array();
    for (const auto& p : others.list(now)) {
        w.begin_object();
        w.plain_key("node");
        w.value(std::string_view{p.node});
        if (!others.pool().empty()) {
            w.plain_key("pool");
            w.value(std::string_view{others.pool()});
        }
        w.plain_key("endpoints");
        w.begin_array();
        for (const auto& endpoint : p.endpoints) {
            w.value(std::string_view{endpoint});
        }
        w.end_array();
        w.plain_key("epoch");
        w.value(std::string_view{p.epoch});
        w.plain_key("age_ms");
        w.value(std::int64_t{p.age.count()});
        w.plain_key("state");
        w.value(to_string(p.state));
        w.plain_key("load");
        write_load(w, p.load);
        w.end_object();
    }
    w.end_array();
    w.end_object();
}

} // namespace cles::core
