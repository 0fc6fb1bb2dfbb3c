#include "frazil/points/point_file.h"

#include <bit>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>

#include "frazil/base/error.h"

namespace frazil {
namespace {

static_assert(std::endian::native == std::endian::little, "PLY is written as memory is");

constexpr std::size_t kRowsAtOnce = 1 << 14;

#pragma pack(push, 1)
struct Row {
    V3f position, normal;
    float area;
    std::int32_t triangle;
    V2f uv;
};
#pragma pack(pop)
static_assert(sizeof(Row) == 40);

constexpr const char* kNames[] = {"x", "y", "z", "nx", "ny", "nz", "area", "triangle", "u", "v"};
constexpr int kFields = 10;

std::size_t type_size(const std::string& type) {
    if (type == "char" || type == "uchar" || type == "int8" || type == "uint8") return 1;
    if (type == "short" || type == "ushort" || type == "int16" || type == "uint16") return 2;
    if (type == "int" || type == "uint" || type == "float" || type == "int32" || type == "uint32" || type == "float32")
        return 4;
    if (type == "double" || type == "float64") return 8;
    return 0;
}

// Where each of our fields lies in a row of the file.
struct Layout {
    std::uint64_t count = 0;
    std::size_t stride = 0;
    std::size_t offsets[kFields];
    bool is_found[kFields] = {};
    double spacing = 0.0;
};

Layout read_header(std::istream& file, const std::string& path) {
    const auto refuse = [&](const std::string& what) {
        throw FileError(path + ": file must be a binary little-endian PLY of points, got " + what +
                        ". Write it with PointSet.save.");
    };
    std::string line, word;
    if (!std::getline(file, line) || line.rfind("ply", 0) != 0) refuse("something else");
    Layout layout;
    bool in_vertices = false, is_binary = false, has_count = false;
    for (int lines = 0; lines < 1000 && std::getline(file, line); ++lines) {
        if (!line.empty() && line.back() == '\r') line.pop_back();
        std::istringstream words(line);
        words >> word;
        if (word == "format") {
            words >> word;
            is_binary = word == "binary_little_endian";
        } else if (word == "comment") {
            if (words >> word && word == "spacing") words >> layout.spacing;
        } else if (word == "element") {
            words >> word;
            if (word != "vertex" && !has_count) refuse("an element '" + word + "' before the vertices");
            in_vertices = word == "vertex";
            if (in_vertices) has_count = static_cast<bool>(words >> layout.count);
        } else if (word == "property" && in_vertices) {
            std::string type, name;
            words >> type >> name;
            const std::size_t size = type_size(type);
            if (size == 0) refuse("a property of type '" + type + "'");
            for (int i = 0; i < kFields; ++i) {
                if (name != kNames[i]) continue;
                const bool is_int = std::string("triangle") == name;
                if (size != 4 || (type[0] == 'f') == is_int) refuse("property " + name + " of type " + type);
                layout.offsets[i] = layout.stride;
                layout.is_found[i] = true;
            }
            layout.stride += size;
        } else if (word == "end_header") {
            if (!is_binary) refuse("another PLY format");
            for (int i = 0; i < kFields; ++i) {
                if (!layout.is_found[i]) refuse(std::string("no property ") + kNames[i]);
            }
            return layout;
        }
    }
    refuse("no end of its header");
    return layout;
}

}  // namespace

void save_points(const PointSet& points, const std::string& path) {
    std::ofstream file(path, std::ios::binary);
    file << "ply\nformat binary_little_endian 1.0\ncomment made by frazil\ncomment spacing ";
    file.precision(17);
    file << points.spacing << "\nelement vertex " << points.size() << "\n";
    for (const char* name : kNames)
        file << "property " << (std::string("triangle") == name ? "int " : "float ") << name << "\n";
    file << "end_header\n";
    std::vector<Row> rows;
    for (std::size_t begin = 0; begin < points.size(); begin += kRowsAtOnce) {
        rows.resize(std::min(kRowsAtOnce, points.size() - begin));
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const std::size_t p = begin + i;
            rows[i] = {points.positions[p], points.normals[p], points.areas[p], points.triangles[p],
                       points.barycentrics[p]};
        }
        file.write(reinterpret_cast<const char*>(rows.data()), static_cast<std::streamsize>(rows.size() * sizeof(Row)));
    }
    file.close();
    if (!file)
        throw FileError(path + ": file must be writable, got an error while writing. Check the folder and disk.");
}

PointSet load_points(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw FileError(path + ": file must be readable, got none. Check the path.");
    const Layout layout = read_header(file, path);
    const auto begin = file.tellg();
    file.seekg(0, std::ios::end);
    const auto bytes = static_cast<std::uint64_t>(file.tellg() - begin);
    file.seekg(begin);
    if (layout.count > bytes / layout.stride) {
        throw FileError(str(path, ": file must hold ", layout.count, " points of ", layout.stride, " bytes, got ",
                            bytes, " bytes. It was cut short; write it again."));
    }
    PointSet points;
    points.spacing = layout.spacing;
    resize(points, layout.count);
    std::vector<char> buffer;
    for (std::size_t first = 0; first < layout.count; first += kRowsAtOnce) {
        const std::size_t rows = std::min<std::size_t>(kRowsAtOnce, layout.count - first);
        buffer.resize(rows * layout.stride);
        if (!file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()))) {
            throw FileError(path + ": file must be readable to its end, got an error. Check the disk.");
        }
        for (std::size_t i = 0; i < rows; ++i) {
            Row row;
            for (int field = 0; field < kFields; ++field) {
                std::memcpy(reinterpret_cast<char*>(&row) + 4 * field,
                            &buffer[i * layout.stride + layout.offsets[field]], 4);
            }
            points.positions[first + i] = row.position;
            points.normals[first + i] = row.normal;
            points.areas[first + i] = row.area;
            points.triangles[first + i] = row.triangle;
            points.barycentrics[first + i] = row.uv;
        }
    }
    return points;
}

}  // namespace frazil
