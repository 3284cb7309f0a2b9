// Blinn-Phong with two directional lights (Blinn 1977) and hemisphere ambient light.
uniform float u_specular;
uniform float u_shininess;

vec3 shade(vec3 position, vec3 normal, vec3 to_eye) {
    vec3 base = base_color().rgb;
    float ambient = ambient_visibility(position.z);
    vec3 color = ambient * ambient_light(normal) * base;
    for (int i = 0; i < 2; ++i) {
        float diffuse = max(dot(normal, u_light_directions[i]), 0.0);
        vec3 halfway = u_light_directions[i] + to_eye;
        float cosine = dot(normal, halfway) * inversesqrt(dot(halfway, halfway));
        float shine = diffuse > 0.0 ? pow(max(cosine, 0.0), u_shininess) : 0.0;
        float seen = visibility(i, position, normal, diffuse);
        // Only the key light has a shadow map; occlusion approximates the rim light's shadow.
        seen *= i == 1 ? mix(1.0, ambient, 0.7) : 1.0;
        color += seen * u_light_colors[i] * (base * diffuse + u_specular * shine);
    }
    return toned(color);
}
