// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace digits {

/// The first line of a file of images, such as "pixels=64,brightest=16,classes=10,best_accuracy=0.97". A line for each
/// image follows: its pixels, whole numbers from 0 to `brightest`, and its class, from 0 on, with commas between them.
struct file_header {
    std::uint32_t pixels = 0;              ///< of an image, 1 to 4096
    std::uint32_t brightest = 0;           ///< 1 to 65535
    std::uint32_t classes = 0;             ///< 2 to 256
    std::optional<double> best_accuracy{}; ///< the best that is known for a set to test with, 0 to 1; may be missing
};

/// Images with their classes. Pixels are from 0 to 1.
class image_set {
  public:
    static constexpr std::size_t most_values = std::size_t{1} << 27U; ///< pixels of all images

    /// \throws std::invalid_argument if a number is out of its range
    explicit image_set(const file_header& like);

    /// All images of these files, which have to be of one kind. \throws std::invalid_argument that names file and line
    static image_set read(const std::vector<std::string>& files);
    /// \param name of the file, for messages
    static image_set parse(std::string_view text, const std::string& name);

    /// A line of a file. \throws std::invalid_argument that says what is wrong
    void add_line(std::string_view line);
    /// \throws std::invalid_argument if they are of another kind
    void check_kind(const image_set& others) const;
    /// \throws std::invalid_argument if they are of another kind, or too many
    void add(const image_set& others);

    [[nodiscard]] const file_header& header() const noexcept { return header_; }
    [[nodiscard]] std::size_t size() const noexcept { return classes_.size(); }
    [[nodiscard]] std::span<const float> image(std::size_t i) const noexcept {
        return std::span{pixels_}.subspan(i * header_.pixels, header_.pixels);
    }
    [[nodiscard]] std::size_t class_of(std::size_t i) const noexcept { return classes_[i]; }

  private:
    file_header header_;
    std::vector<float> pixels_{};
    std::vector<std::uint8_t> classes_{};
};

} // namespace digits
