// SPDX-License-Identifier: BSL-1.0
#include "gateway/told/openapi.hpp"

#include <cles/convert.hpp>
#include <cles/error.hpp>
#include <cles/json_reader.hpp>
#include <cles/json_writer.hpp>
#include <cles/version.hpp>

#include "gateway/http/message.hpp"
#include "gateway/http/route.hpp"
#include "gateway/told/metrics.hpp"
#include "gateway/told/told_limits.hpp"

#include <boost/describe/class.hpp>

#include <algorithm>
#include <cstddef>
#include <set>

namespace gateway {

BOOST_DESCRIBE_STRUCT(offered_task, (), (verb, task, description, parameters))

namespace {

struct described_node {
    std::optional<std::string> types{};
    std::optional<std::vector<offered_task>> tasks{};
};
BOOST_DESCRIBE_STRUCT(described_node, (), (types, tasks))

constexpr std::size_t most_bytes = 8U << 20U; // of all schemas
constexpr std::size_t most_operations = 4096;

// What operations share.
constexpr std::string_view shared_components =
    R"("failure":{"type":"object","properties":{"error":{"type":"string"},"message":{"type":"string"},)"
    R"("retry_ms":{"type":"integer"},"ran":{"type":"boolean"}},"required":["error"]}},)"
    R"("parameters":{"deadline":{"name":"Cles-Deadline","in":"header","description":"How many milliseconds the client )"
    R"(waits","schema":{"type":"integer","minimum":1}},"every":{"name":"every","in":"query","description":"The least )"
    R"(milliseconds between two updates","schema":{"type":"integer","minimum":1}},"keep":{"name":"keep","in":"query",)"
    R"("description":"How many updates the publisher queues","schema":{"type":"integer","minimum":1}},)"
    R"("last":{"name":"Last-Event-ID","in":"header","description":"The last event that the client has received",)"
    R"("schema":{"type":"string"}}},"responses":{"failure":{"description":"A failure","content":{"application/json":)"
    R"({"schema":{"$ref":"#/components/schemas/failure"}}}}},"securitySchemes":{"token":{"type":"http","scheme":"bearer"}})";

constexpr std::string_view terms_of_binding = R"(,{"$ref":"#/components/parameters/every"},)"
                                              R"({"$ref":"#/components/parameters/keep"},)"
                                              R"({"$ref":"#/components/parameters/last"})";

// A node may tell anything; what is no schema would make the whole document invalid.
bool is_schema(std::string_view text) {
    try {
        const cles::schema read{text};
        return true;
    } catch (const cles::error&) {
        return false;
    }
}

// The schema on one line. In the document, references to the schema's own root lead to that of the document.
std::string moved_schema(std::string_view schema, std::string_view root) {
    constexpr std::string_view reference = R"("$ref":"#)";
    std::string compact;
    cles::append_compact_json(schema, compact);
    std::string moved;
    std::size_t from = 0;
    for (auto at = compact.find(reference); at != std::string::npos; at = compact.find(reference, from)) {
        const auto end = at + reference.size();
        moved.append(compact, from, end - 1 - from).append(root);
        from = end;
    }
    moved.append(compact, from, std::string::npos);
    return moved;
}

/// The schemas of the document, as the members of an object.
class schema_members {
  public:
    /// Adds one. \return a reference to it; {}, which anything fits, if there is none that can be used, or no room
    std::string add(const std::string& name, std::string_view schema) {
        if (schema.empty() || !has_room(schema) || !is_schema(schema)) {
            return "{}";
        }
        const auto root = "#/components/schemas/" + name;
        const auto moved = moved_schema(schema, root);
        if (!has_room(moved)) { // a short reference may have become a long one
            return "{}";
        }
        text_.append(json_string(name)).append(":").append(moved).append(",");
        return R"({"$ref":)" + json_string(root) + "}";
    }
    [[nodiscard]] const std::string& text() const noexcept { return text_; }

  private:
    [[nodiscard]] bool has_room(std::string_view schema) const noexcept {
        return text_.size() + schema.size() <= most_bytes;
    }

    std::string text_;
};

// The names of its parameters in a path. They are free text, so only those that are plain are used.
std::vector<std::string> parameter_names(const offered_task& task) {
    std::vector<std::string> names;
    for (const auto& stated : task.parameters.value_or(std::vector<std::string>{})) {
        const bool is_plain =
            !stated.empty() && stated.size() <= told_limits::parameter && std::ranges::all_of(stated, [](char c) {
                return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
            });
        const bool is_new = std::ranges::find(names, stated) == names.end();
        names.push_back(is_plain && is_new ? stated : "p" + std::to_string(names.size() + 1));
    }
    return names;
}

// "/push/car1/target":{"post":{...}}
std::string operation_text(const offering_node& node, const offered_task& task, const verb_path& how,
                           schema_members& schemas) {
    const auto found = node.schemas.find({task.verb, task.task});
    const cles::task_schemas none{};
    const auto& told = found == node.schemas.end() ? none : found->second;
    const auto name = node.name + "." + task.verb + "." + task.task;
    const bool is_stream = how.verb == cles::verb::bind;
    const auto result =
        is_stream ? schemas.add(name + ".updates", told.updates) : schemas.add(name + ".result", told.result);
    auto path = "/" + std::string{how.name} + "/" + node.name + "/" + task.task;
    std::string parameters;
    for (const auto& parameter : parameter_names(task)) {
        path.append("/{").append(parameter).append("}");
        parameters.append(R"({"name":)").append(json_string(parameter));
        parameters.append(R"(,"in":"path","required":true,"schema":{"type":"string"}},)");
    }
    parameters.append(R"({"$ref":"#/components/parameters/deadline"})").append(is_stream ? terms_of_binding : "");
    auto out = json_string(path) + R"(:{")" + small_letters(how.method) + R"(":{"operationId":)";
    out.append(json_string(path.substr(1))).append(R"(,"summary":)");
    out.append(json_string(task.description.value_or(task.verb + " " + node.name + ":" + task.task)));
    out.append(R"(,"tags":[)").append(json_string(node.name)).append(R"(],"parameters":[)").append(parameters);
    if (how.method == "POST") {
        out.append(R"(],"requestBody":{"content":{"application/json":{"schema":)");
        out.append(schemas.add(name + ".body", told.body)).append("}}}");
    } else {
        out.append("]");
    }
    out.append(R"(,"responses":{"200":{"description":)")
        .append(is_stream ? R"("Events, whose data are updates")" : R"("The result")");
    out.append(R"(,"content":{")")
        .append(is_stream ? "text/event-stream" : "application/json")
        .append(R"(":{"schema":)");
    return out.append(result).append(R"(}}},"default":{"$ref":"#/components/responses/failure"}}}})");
}

// Leaves out what clients could not request, and what is too long.
std::vector<offered_task> usable_tasks(std::vector<offered_task> told) {
    std::erase_if(told, [](const offered_task& each) {
        return find_verb_path(each.verb) == nullptr || !is_node_or_task(each.task) ||
               (each.parameters && each.parameters->size() > most_parameters);
    });
    told.resize(std::min(told.size(), told_limits::tasks));
    for (auto& each : told) {
        if (each.description && each.description->size() > told_limits::description) {
            each.description.reset();
        }
    }
    return told;
}

} // namespace

std::vector<offering_node> offering_nodes(const std::map<std::string, std::string>& replies) {
    std::vector<offering_node> found;
    for (const auto& [name, json] : replies) {
        described_node read;
        if (is_node_or_task(name) && cles::from_json(json, read) && read.tasks) {
            auto types = read.types.value_or(std::string{});
            found.push_back({.name = name,
                             .types = types.size() <= told_limits::digest ? std::move(types) : std::string{},
                             .tasks = usable_tasks(std::move(*read.tasks)),
                             .schemas = {}});
        }
    }
    return found;
}

void add_schemas(offering_node& node, const std::string& task, std::string_view reply) {
    cles::json_reader r{reply, cles::json_writer::most_levels};
    std::string_view key;
    bool good = r.begin_object();
    while (good && r.next_key(key)) {
        const std::string verb{key};
        std::string_view raw;
        good = r.read_raw(raw);
        if (find_verb_path(verb) == nullptr) {
            continue;
        }
        try {
            node.schemas.insert_or_assign({verb, task}, cles::read_task_types(raw));
        } catch (const cles::error&) { // a node may say anything about itself
            continue;
        }
    }
}

std::string openapi_document(const std::vector<offering_node>& nodes) {
    schema_members schemas;
    std::string paths;
    std::set<std::string> told;
    for (const auto& node : nodes) {
        for (const auto& task : node.tasks) {
            const auto* const how = find_verb_path(task.verb);
            const bool is_plain = is_node_or_task(node.name) && is_node_or_task(task.task);
            if (how != nullptr && is_plain && told.size() < most_operations &&
                told.insert(task.verb + " " + node.name + ":" + task.task).second) {
                paths.append(paths.empty() ? "" : ",").append(operation_text(node, task, *how, schemas));
            }
        }
    }
    return R"({"openapi":"3.1.0","info":{"title":"CLES gateway","version":)" + json_string(cles::version) +
           R"(},"security":[{},{"token":[]}],"paths":{)" + paths + R"(},"components":{"schemas":{)" + schemas.text() +
           std::string{shared_components} + "}}";
}

} // namespace gateway
