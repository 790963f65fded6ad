# Shows a .glb of `prt export glb --weights` in Godot 4, and relights it.
# Put it on a Node3D; call relight(func(direction): return Color) with linear radiance, y up.
extends Node3D

const ROWS_OF_ONE := 256  # vertices beside each other in the texture of weights

@export_file("*.glb") var file: String
@export var shader: Shader  # prt.gdshader

var json: Dictionary
var binary: PackedByteArray
var side: Dictionary
var products: ImageTexture
var directions: PackedFloat32Array
var groups: Array = []

func _ready() -> void:
	var bytes := FileAccess.get_file_as_bytes(file)
	var length := bytes.decode_u32(12)
	json = JSON.parse_string(bytes.slice(20, 20 + length).get_string_from_utf8())
	binary = bytes.slice(28 + length)
	side = json.extras.PRT.weights
	directions = floats(side.directions)
	for group in side.groups:
		var read := {"rows": shorts(group.rows), "scale": floats(group.scale)}
		read.shares = group.shares
		if group.has("mix"):
			read.mix = floats(group.mix)
		groups.append(read)
	var image := Image.create(1 + int(side.components), int(side.clusters), false, Image.FORMAT_RGBF)
	products = ImageTexture.create_from_image(image)
	for node in json.nodes:
		add_child(_instance(node))
	relight(func(_direction): return Color.WHITE)

func relight(radiance: Callable) -> void:
	var texels := int(side.texels)
	var light := PackedFloat32Array()
	for i in texels:
		var at := Vector3(directions[3 * i], directions[3 * i + 1], directions[3 * i + 2])
		var colour: Color = radiance.call(at)
		light.append_array([colour.r, colour.g, colour.b])
	var count := int(side.clusters) * (1 + int(side.components))
	var total := PackedFloat32Array()
	total.resize(3 * count)
	for group in groups:
		var each := _times(group.rows, light, group.scale.size(), texels)
		for row in group.scale.size():
			for channel in 3:
				each[3 * row + channel] *= group.scale[row] / 32767.0
		if group.has("mix"):
			each = _times(group.mix, each, count, group.scale.size())
		for i in 3 * count:
			total[i] += group.shares[i % 3] * each[i]
	products.update(Image.create_from_data(1 + int(side.components), int(side.clusters), false,
			Image.FORMAT_RGBF, total.to_byte_array()))

func _times(matrix, light: PackedFloat32Array, rows: int, columns: int) -> PackedFloat32Array:
	var result := PackedFloat32Array()
	for row in rows:
		var sum := Vector3.ZERO
		for column in columns:
			sum += matrix[row * columns + column] * Vector3(
					light[3 * column], light[3 * column + 1], light[3 * column + 2])
		result.append_array([sum.x, sum.y, sum.z])
	return result

func _instance(node: Dictionary) -> MeshInstance3D:
	var mesh := ArrayMesh.new()
	for primitive in json.meshes[int(node.mesh)].primitives:
		var of: Dictionary = primitive.attributes
		var arrays := []
		arrays.resize(Mesh.ARRAY_MAX)
		arrays[Mesh.ARRAY_VERTEX] = _vectors(floats(of.POSITION))
		arrays[Mesh.ARRAY_NORMAL] = _vectors(floats(of.NORMAL))
		var indices := integers(primitive.indices)
		for i in range(0, indices.size(), 3):  # Godot's fronts go round clockwise
			var second := indices[i + 1]
			indices[i + 1] = indices[i + 2]
			indices[i + 2] = second
		arrays[Mesh.ARRAY_INDEX] = indices
		mesh.add_surface_from_arrays(Mesh.PRIMITIVE_TRIANGLES, arrays)
		var material := ShaderMaterial.new()
		material.shader = shader
		material.set_shader_parameter("weights", _weights(of, arrays[Mesh.ARRAY_VERTEX].size()))
		material.set_shader_parameter("products", products)
		material.set_shader_parameter("components", int(side.components))
		mesh.surface_set_material(mesh.get_surface_count() - 1, material)
	var item := MeshInstance3D.new()
	item.name = node.name.validate_node_name()
	item.mesh = mesh
	var turn: Array = node.get("rotation", [0, 0, 0, 1])
	var size: Array = node.get("scale", [1, 1, 1])
	var place: Array = node.get("translation", [0, 0, 0])
	var rotated := Basis(Quaternion(turn[0], turn[1], turn[2], turn[3]))
	item.transform = Transform3D(
			rotated * Basis.from_scale(Vector3(size[0], size[1], size[2])),
			Vector3(place[0], place[1], place[2]))
	return item

func _weights(of: Dictionary, count: int) -> ImageTexture:
	var fours := []
	for attribute in side.attributes:
		fours.append(floats(of[attribute]))
	var albedo = floats(of._PRT_ALBEDO) if of.has("_PRT_ALBEDO") else null
	var cluster := floats(of._PRT_CLUSTER)
	var height := ceili(float(count) / ROWS_OF_ONE)
	var texels := fours.size() + 1
	var values := PackedFloat32Array()
	values.resize(4 * texels * ROWS_OF_ONE * height)
	for vertex in count:
		var at := 4 * texels * vertex
		for i in fours.size():
			for k in 4:
				values[at + 4 * i + k] = fours[i][4 * vertex + k]
		for k in 3:
			values[at + 4 * fours.size() + k] = albedo[3 * vertex + k] if albedo != null else 1.0
		values[at + 4 * fours.size() + 3] = cluster[vertex]
	return ImageTexture.create_from_image(Image.create_from_data(
			texels * ROWS_OF_ONE, height, false, Image.FORMAT_RGBAF, values.to_byte_array()))

func _vectors(values: PackedFloat32Array) -> PackedVector3Array:
	var result := PackedVector3Array()
	for i in range(0, values.size(), 3):
		result.append(Vector3(values[i], values[i + 1], values[i + 2]))
	return result

func _part(number) -> PackedByteArray:
	var view: Dictionary = json.bufferViews[int(json.accessors[int(number)].bufferView)]
	return binary.slice(int(view.byteOffset), int(view.byteOffset + view.byteLength))

func floats(number) -> PackedFloat32Array:
	return _part(number).to_float32_array()

func shorts(number) -> PackedFloat32Array:
	var bytes := _part(number)
	var result := PackedFloat32Array()
	for i in int(json.accessors[int(number)].count):
		result.append(bytes.decode_s16(2 * i))
	return result

func integers(number) -> PackedInt32Array:
	var bytes := _part(number)
	if json.accessors[int(number)].componentType == 5125:
		return bytes.to_int32_array()
	var result := PackedInt32Array()
	for i in int(json.accessors[int(number)].count):
		result.append(bytes.decode_u16(2 * i))
	return result
