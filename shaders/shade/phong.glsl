// Blinn-Phong with two directional lights (Blinn 1977) and constant ambient light.
uniform vec3 u_light_directions[2];  // towards each light, unit length, camera space
uniform vec3 u_light_colors[2];      // linear, multiplied by strength
uniform float u_ambient;
uniform float u_specular;
uniform float u_shininess;

vec3 shade(vec3 position, vec3 normal, vec3 to_eye) {
    vec3 base = base_color().rgb;
    vec3 color = u_ambient * base;
    for (int i = 0; i < 2; ++i) {
        float diffuse = max(dot(normal, u_light_directions[i]), 0.0);
        vec3 halfway = normalize(u_light_directions[i] + to_eye);
        float shine = diffuse > 0.0 ? pow(max(dot(normal, halfway), 0.0), u_shininess) : 0.0;
        color += u_light_colors[i] * (base * diffuse + u_specular * shine);
    }
    return color;
}
