// WebGL objects: programs with uniforms by name, textures of numbers and of pictures.

class Programs {
  constructor(gl, texts) {
    this.gl = gl;
    this.texts = texts;
    this.made = {};
  }

  // Returns the program of a name in the header; outputs are captured by transform feedback.
  get(name, outputs = []) {
    if (!(name in this.made)) this.made[name] = this.compile(name, outputs);
    return this.made[name];
  }

  compile(name, outputs) {
    const gl = this.gl, program = gl.createProgram();
    [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, index) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, this.texts[name][index]);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS))
        throw new Error(`${name}: ${gl.getShaderInfoLog(shader)}`);
      gl.attachShader(program, shader);
    });
    if (outputs.length) gl.transformFeedbackVaryings(program, outputs, gl.INTERLEAVED_ATTRIBS);
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS))
      throw new Error(`${name}: ${gl.getProgramInfoLog(program)}`);
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++i) {
      const { name: title, type, size } = gl.getActiveUniform(program, i);
      const place = gl.getUniformLocation(program, title);
      uniforms[title.replace("[0]", "")] = { type, size, place };
    }
    return { program, uniforms };
  }
}

// Sets uniforms by name; those that the compiler removed as unused are skipped.
function setUniforms(gl, { program, uniforms }, values) {
  gl.useProgram(program);
  for (const [name, value] of Object.entries(values)) {
    if (!(name in uniforms)) continue;
    const { type, size, place } = uniforms[name];
    const numbers = Array.isArray(value) ? value : [Number(value)];
    // Compilers remove the unused end of an array.
    const first = (width) => numbers.slice(0, width * size);
    if (type === gl.FLOAT) gl.uniform1fv(place, first(1));
    else if (type === gl.FLOAT_VEC2) gl.uniform2fv(place, first(2));
    else if (type === gl.FLOAT_VEC3) gl.uniform3fv(place, first(3));
    else if (type === gl.FLOAT_VEC4) gl.uniform4fv(place, first(4));
    else if (type === gl.FLOAT_MAT3) gl.uniformMatrix3fv(place, false, first(9));
    else if (type === gl.FLOAT_MAT4) gl.uniformMatrix4fv(place, false, first(16));
    else gl.uniform1iv(place, first(1));
  }
}

// Returns a vertex array of a program: attributes by name, as [buffer, width, stride, offset].
function vertexArray(gl, { program }, attributes, indices = null) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  for (const [name, [buffer, width, stride, offset]] of Object.entries(attributes)) {
    const place = gl.getAttribLocation(program, name);
    if (place < 0) continue;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(place);
    if (name === "in_bindings") gl.vertexAttribIPointer(place, width, gl.UNSIGNED_INT, 0, 0);
    else gl.vertexAttribPointer(place, width, gl.FLOAT, false, stride || 0, offset || 0);
  }
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, indices);
  gl.bindVertexArray(null);
  return array;
}

function bufferOf(gl, data, kind = gl.ARRAY_BUFFER, usage = gl.STATIC_DRAW) {
  const buffer = gl.createBuffer();
  gl.bindVertexArray(null);
  gl.bindBuffer(kind, buffer);
  gl.bufferData(kind, data, usage);
  return buffer;
}

// A texture of numbers in rows of texels, as upload.py makes it for the shaders.
class NumberTexture {
  constructor(gl, count, perRow, channels) {
    this.gl = gl;
    this.width = perRow;
    this.height = Math.max(1, Math.ceil(count / perRow));
    this.format = channels === 2 ? gl.RG : gl.RGBA;
    this.data = new Float32Array(this.width * this.height * channels);
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    const inner = channels === 2 ? gl.RG32F : gl.RGBA32F;
    gl.texStorage2D(gl.TEXTURE_2D, 1, inner, this.width, this.height);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, side, gl.NEAREST);
  }

  write() {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0);  // the units of the studio and the shadow map stay as they are
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, this.width, this.height, this.format, gl.FLOAT, this.data);
  }

  use(unit) {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, this.texture);
  }
}

// A mip-mapped texture of a picture; larger ones than the driver takes are reduced.
function pictureTexture(gl, bitmap, { isLinear, repeats, isSmooth, minification }) {
  const limit = gl.getParameter(gl.MAX_TEXTURE_SIZE), texture = gl.createTexture();
  let source = bitmap;
  if (Math.max(bitmap.width, bitmap.height) > limit) {
    const factor = limit / Math.max(bitmap.width, bitmap.height);
    source = new OffscreenCanvas(Math.floor(bitmap.width * factor), Math.floor(bitmap.height * factor));
    source.getContext("2d").drawImage(bitmap, 0, 0, source.width, source.height);
  }
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, isLinear ? gl.RGBA8 : gl.SRGB8_ALPHA8, gl.RGBA, gl.UNSIGNED_BYTE, source);
  gl.generateMipmap(gl.TEXTURE_2D);
  [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T].forEach((side, axis) =>
    gl.texParameteri(gl.TEXTURE_2D, side, repeats[axis] ? gl.REPEAT : gl.CLAMP_TO_EDGE));
  const usual = isSmooth ? "linear_mipmap_linear" : "nearest_mipmap_linear";
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl[(minification || usual).toUpperCase()]);
  gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, isSmooth ? gl.LINEAR : gl.NEAREST);
  return texture;
}

// Binds the studio's light and the split-sum table; pack_studio has written them.
function useStudio(gl, studio, arrays, samplers) {
  const [green, red, blue] = studio.light.map((item) => arrays[item].values);
  const light = new Float32Array(3 * green.length);
  green.forEach((value, i) => light.set([value + red[i], value, value + blue[i]].map(Math.pow.bind(null, 2)), 3 * i));
  const bind = (kind, unit) => {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(kind, gl.createTexture());
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(kind, side, gl.LINEAR);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(kind, side, gl.CLAMP_TO_EDGE);
  };
  const { side, layers, table, tableSide } = studio;
  bind(gl.TEXTURE_2D_ARRAY, samplers.u_studio);
  gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.RGB16F, side, side, layers, 0, gl.RGB, gl.FLOAT, light);
  bind(gl.TEXTURE_2D, samplers.u_split_sum);
  const factors = Float32Array.from(arrays[table].values);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RG16F, tableSide, tableSide, 0, gl.RG, gl.FLOAT, factors);
}
