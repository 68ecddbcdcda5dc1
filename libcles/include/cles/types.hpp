// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/handler_shape.hpp>
#include <cles/registrar.hpp>
#include <cles/schema.hpp>
#include <cles/standard.hpp>
#include <cles/task_info.hpp>
#include <cles/type_schema.hpp>
#include <cles/verb.hpp>

#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

/// Tasks that tell their types (docs/library_reference.md, "Types that are told"). Only programs that include this
/// header compile and link what it needs.

namespace cles {

namespace detail {
struct types_part;

/// Adds `told` to the description of a task, and the names of its parameters if nothing is told of them.
void add_types(task_info& info, std::string_view what, task_schemas told);
} // namespace detail

/// Returns a value for `service_options::types`, which makes the service answer `PULL self:cles/types/<task>` and
/// `PULL self:cles/nouns`. Only programs that call this function link its code.
const detail::types_part* types() noexcept;

/// The JSON Schema of what is sent of a T: as a body, a result or an update. A scalar is sent as {"value":x}.
template <class T>
[[nodiscard]] std::string schema_of() {
    detail::schema_writer writer;
    detail::write_schema<detail::content<T>>(writer);
    return writer.finish();
}

/// Registers tasks as a `registrar` does, with the types of their handlers:
///
///     void register_tasks(cles::registrar& to) {
///         cles::typed_registrar tasks{to};
///         tasks.on_push("target", [](const position& where) { steer(where); });
///         tasks.on_bind<position>("localization");
///     }
///
/// What `stated` contains replaces what is derived: it is the only source for handlers of `json_text`, and for results
/// of handlers that take a responder. \throws cles::error as the registrar does, and `invalid_option` if a stated
/// schema is not one of the subset
class typed_registrar {
  public:
    explicit typed_registrar(registrar& to) noexcept : to_(to) {}

    template <class F>
    void on_pull(std::string_view task, F handler, task_info info = {}, task_schemas stated = {}) {
        describe<verb::pull, F>(task, info, std::move(stated));
        to_.on_pull(task, std::move(handler), std::move(info));
    }
    template <class F>
    void on_push(std::string_view task, F handler, task_info info = {}, task_schemas stated = {}) {
        describe<verb::push, F>(task, info, std::move(stated));
        to_.on_push(task, std::move(handler), std::move(info));
    }
    template <class F>
    void on_delegate(std::string_view task, F handler, task_info info = {}, task_schemas stated = {}) {
        describe<verb::delegate, F>(task, info, std::move(stated));
        to_.on_delegate(task, std::move(handler), std::move(info));
    }
    /// The body is what is published.
    template <class F>
    void on_update(std::string_view task, F handler, task_info info = {}, task_schemas stated = {}) {
        describe<verb::update, F>(task, info, std::move(stated));
        to_.on_update(task, std::move(handler), std::move(info));
    }
    /// \tparam Update the type of what is published
    template <class Update>
    void on_bind(std::string_view task, task_info info = {}) {
        detail::add_types(info, task, {.updates = schema_of<Update>()});
        to_.on_bind(task, std::move(info));
    }
    template <class Update, class F>
    void on_bind(std::string_view task, F handler, task_info info = {}) requires(!std::is_convertible_v<F, task_info>) {
        detail::add_types(info, task, {.updates = schema_of<Update>()});
        to_.on_bind(task, std::move(handler), std::move(info));
    }

    [[nodiscard]] publisher make_publisher() { return to_.make_publisher(); }

  private:
    static void derive(std::string& into, std::string made) {
        if (into.empty() && made != "{}") { // anything: nothing is known
            into = std::move(made);
        }
    }

    template <cles::verb Verb, class F>
    static void describe(std::string_view task, task_info& info, task_schemas stated) {
        if constexpr (detail::one_signature<F>) { // otherwise the registrar says what is wrong
            using shape = detail::handler_shape<F>;
            if constexpr (shape::takes_texts) {
                derive(stated.parameters, R"({"type":"array","items":{"type":"string"}})");
            } else if constexpr (shape::takes_body && shape::arity <= 2) {
                using body = typename shape::template argument<shape::arity - 1>;
                if constexpr (detail::readable<body>) {
                    derive(stated.body, schema_of<body>());
                }
            }
            if constexpr (Verb == verb::update) {
                derive(stated.updates, stated.body.empty() ? std::string{"{}"} : stated.body);
            }
            using result = std::remove_cvref_t<typename detail::awaited<typename shape::result>::type>;
            if constexpr (!shape::takes_responder && (std::is_void_v<result> || detail::writable<result>)) {
                derive(stated.result, schema_of<result>());
            }
        }
        detail::add_types(info, task, std::move(stated));
    }

    registrar& to_;
};

} // namespace cles
