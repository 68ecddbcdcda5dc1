// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>
#include <cles/json_writer.hpp>
#include <cles/types.hpp>

namespace cles::detail {
namespace {

// The parameters of a request are texts; those that are named may be missing.
std::string schema_of_parameters(const text_list& names) {
    std::string out;
    json_writer w{out};
    w.begin_object();
    w.plain_key("type");
    w.value(std::string_view{"array"});
    w.plain_key("prefixItems");
    w.begin_array();
    for (const auto& name : names) {
        w.begin_object();
        w.plain_key("title");
        w.value(std::string_view{name});
        w.plain_key("type");
        w.value(std::string_view{"string"});
        w.end_object();
    }
    w.end_array();
    w.end_object();
    return out;
}

} // namespace

void add_types(task_info& info, std::string_view what, task_schemas told) {
    if (told.parameters.empty() && !info.parameters.empty()) {
        told.parameters = schema_of_parameters(info.parameters);
    }
    try {
        info.types = task_types(told);
    } catch (const error& e) {
        throw error(e.code(), "'" + std::string{what} + "': " + e.message());
    }
}

} // namespace cles::detail
