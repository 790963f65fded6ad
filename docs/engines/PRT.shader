// Relit colours in Unity (built-in pipeline), of weights in the UV channels of a mesh.
//
// TEXCOORD1 to TEXCOORD6 are _PRT_W0 to _PRT_W5, TEXCOORD7 is _PRT_ALBEDO with _PRT_CLUSTER as w:
// mesh.SetUVs(1, vectors) and so on, from a script that reads the .glb. _Products is a texture in
// float (RGBAFloat, point filter): a row for each cluster, its mean and a texel for each component.
Shader "PRT/Relit"
{
    Properties
    {
        _Products ("Products", 2D) = "black" {}
        _Components ("Components", Int) = 24
        _Base ("Base Color", Color) = (1, 1, 1, 1)
    }
    SubShader
    {
        Cull Off
        Pass
        {
            HLSLPROGRAM
            #pragma vertex vert
            #pragma fragment frag
            #pragma target 4.5
            #include "UnityCG.cginc"

            Texture2D<float4> _Products;
            int _Components;
            float4 _Base;

            struct Vertex
            {
                float4 place : POSITION;
                float4 weights[6] : TEXCOORD1;
                float4 own : TEXCOORD7;
            };

            struct Shown
            {
                float4 place : SV_POSITION;
                float3 colour : TEXCOORD0;
            };

            Shown vert (Vertex v)
            {
                int cluster = (int)(v.own.w + 0.5);
                float3 colour = _Products.Load(int3(0, cluster, 0)).rgb;
                [unroll(24)]
                for (int k = 0; k < 24; k++)
                    if (k < _Components)
                        colour += v.weights[k / 4][k % 4] * _Products.Load(int3(k + 1, cluster, 0)).rgb;
                Shown shown;
                shown.place = UnityObjectToClipPos(v.place);
                shown.colour = v.own.rgb * colour;
                return shown;
            }

            float4 frag (Shown shown) : SV_Target
            {
                return float4(_Base.rgb * max(shown.colour, 0), _Base.a);
            }
            ENDHLSL
        }
    }
}
